/*
 * One fuzz input is a story told to the virtual board: a list of acts, each a byte for what and a byte for how much.
 *
 *   0 n       let n * 1009 us pass          3 n       an edge of the trigger pin, falling if n is odd
 *   1 n ...   n bytes of rubbish            4 n       the port closes (n even) or opens (n odd)
 *   2 n ...   a packet: type, payload of n  5 n       n & 3 transfers break off; n & 4: the host takes no bytes
 *
 * After each act these hold: the LEDs draw no more than the limit, every reply is well framed, the state is bounded.
 */
#include <stdlib.h>

#include "board.h"

#include "bytes.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define TIME_UNIT_US 1009u

static void require(bool holds)
{
    if (!holds)
        abort();
}

static void check_replies(struct board *board)
{
    static uint8_t bytes[BOARD_OUTPUT_BYTES];
    struct packet_receiver receiver = {.count = 0};
    struct packet packet;
    uint32_t count = board_take_output(board, bytes, sizeof bytes);
    for (uint32_t i = 0; i < count; i++) {
        enum packet_result result = packet_receive(&receiver, bytes[i], &packet);
        require(result == (bytes[i] ? PACKET_NONE : PACKET_COMPLETE));
        require(bytes[i] || packet.type & (REPLY | EVENT));
    }
    require(!receiver.count);
}

static void check_state(const struct board *board)
{
    const struct controller *controller = &board->controller;
    const struct sequencer *sequencer = &controller->sequencer;
    uint32_t value;
    require(board_current_ua(board) <= controller->limits.limit_ma * 1000u || !board->light_count);
    require(controller->limits.limit_ma <= (controller->config.current.external_supply ? 2000u : 450u));
    require(sequencer->next.step < STEP_COUNT && sequencer->active.step_count <= STEP_COUNT);
    require(controller->reply_count <= PACKET_WIRE_BYTES);
    require(config_valid(&controller->config.current, &value));
    require(controller_healthy(controller));
}

static void send_packet(struct board *board, const uint8_t *body, uint8_t count)
{
    static uint8_t sequence;
    struct packet packet = {.type = body[0], .sequence = sequence++, .count = count};
    uint8_t wire[PACKET_WIRE_BYTES];
    bytes_copy(packet.payload, body + 1, count);
    board_receive(board, wire, (uint32_t)packet_encode(&packet, wire));
}

/* Perform one act and return how many bytes it took, 0 at the end of the story. */
static size_t perform(struct board *board, const uint8_t *act, size_t left)
{
    uint8_t amount = left > 1 ? act[1] : 0;
    if (left < 2)
        return 0;
    switch (act[0] % 6) {
    case 0:
        board_advance(board, amount * (uint64_t)TIME_UNIT_US);
        return 2;
    case 1:
        if (left < 2u + amount)
            return 0;
        board_receive(board, act + 2, amount);
        return 2u + amount;
    case 2:
        if (amount > PACKET_PAYLOAD_BYTES || left < 3u + amount)
            return 0;
        send_packet(board, act + 2, amount);
        return 3u + amount;
    case 3:
        board_edge(board, amount & 1);
        return 2;
    case 4:
        board_link(board, amount & 1, DARK_PORT_CLOSED);
        return 2;
    default:
        board_fault(board, amount & 4, amount & 3, -1);
        return 2;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct board *board = board_new(NULL);
    board_link(board, true, 0);
    for (size_t at = 0, took = 1; took && at < size; at += took) {
        took = perform(board, data + at, size - at);
        check_replies(board);
        check_state(board);
    }
    board_free(board);
    return 0;
}
