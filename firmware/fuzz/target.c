/*
 * Tell a story (story.h) to the virtual board. After each act these hold: the LEDs draw no more than the limit, every
 * reply is well framed, the state is bounded.
 */
#include <stdlib.h>

#include "board.h"

#include "bytes.h"
#include "story.h"

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

/* What may be drawn: dark LEDs draw what they do, also where a configuration says that it is more than its limit. */
static uint32_t most_ma(const struct ring_limits *limits)
{
    static const uint8_t dark[COLOUR_BYTES];
    uint16_t dark_ma = ring_current_ma(limits, dark);
    return limits->limit_ma > dark_ma ? limits->limit_ma : dark_ma;
}

static void check_state(const struct board *board)
{
    const struct controller *controller = &board->controller;
    const struct sequencer *sequencer = &controller->sequencer;
    uint32_t value;
    const struct controller_slot *slot = &controller->slot;
    uint32_t limit_ma = controller->limits.limit_ma;
    /* where the limit has just become lower, what is above it is lit or on its way until the next light, which is not */
    require(!slot->busy || slot->current_ma <= most_ma(&controller->limits) || controller->still_wanted);
    require(board_current_ua(board) <= most_ma(&controller->limits) * 1000u || slot->busy || controller->still_wanted);
    require(limit_ma <= controller->granted.limit_ma && controller->limits.channel_ua >= controller->granted.channel_ua);
    require(sequencer->next.step < STEP_COUNT && sequencer->active.step_count <= STEP_COUNT);
    require(controller->reply_count <= PACKET_WIRE_BYTES);
    require(config_valid(&controller->config.current, &value));
    require(controller_healthy(controller));
    require(controller->open || !controller->sequencer.running);
}

static uint8_t sequence; /* of the next request */

static void send_packet(struct board *board, const uint8_t *body, uint8_t count)
{
    struct packet packet = {.type = body[0], .sequence = sequence++, .count = count};
    uint8_t wire[PACKET_WIRE_BYTES];
    bytes_copy(packet.payload, body + 1, count);
    board_receive(board, wire, (uint32_t)packet_encode(&packet, wire));
}

static void commit(struct board *board, uint8_t amount)
{
    struct commit request = {.step_count = (uint8_t)(1u + (amount & 31u)), .loops = amount >> 6};
    uint8_t body[1 + sizeof request] = {COMMAND_COMMIT};
    request.table_crc = sequencer_table_crc(&board->controller.sequencer.staged, request.step_count,
                                            board->controller.limits.led_count);
    bytes_copy(body + 1, &request, sizeof request);
    send_packet(board, body, sizeof request);
}

static void perform(struct board *board, const uint8_t *act)
{
    uint8_t amount = act[1];
    switch (act[0] % ACTS) {
    case ACT_RUBBISH:
        board_receive(board, act + 2, amount);
        break;
    case ACT_REQUEST:
        send_packet(board, act + 2, amount);
        break;
    case ACT_TRIGGER:
        board_edge(board, amount & 1);
        break;
    case ACT_LINK:
        board_link(board, amount & 1, DARK_PORT_CLOSED);
        break;
    case ACT_FAULT:
        board_fault(board, amount & 4, false, -1);
        break;
    case ACT_COMMIT:
        commit(board, amount);
        break;
    case ACT_HEAT:
        if (amount >= HEAT_RING)
            board_warm_ring(board, story_reading(amount));
        else
            board_warm(board, 10 * amount);
        break;
    default:
        board_advance(board, amount * (uint64_t)TIME_UNIT_US);
    }
}

/* The board as it is when a story begins. It lies where it lay, so that it may point into itself; to start it costs more
 * than most stories. */
static struct board *begun(void)
{
    static struct board *board, *as_begun;
    if (!board) {
        board = board_new(NULL, 0);
        board_link(board, true, 0);
        as_begun = malloc(sizeof *board);
        require(as_begun != NULL);
        *as_begun = *board;
    }
    *board = *as_begun;
    return board;
}

/* The board, or one that starts anew from its flash if it was told to restart. */
static struct board *started(struct board *board, const struct board *first)
{
    static uint8_t flash[BOARD_FLASH_BYTES];
    if (!(board_flags(board) & 2u))
        return board;
    uint32_t saves = board_noted_saves(board);
    board_flash(board, flash);
    if (board != first)
        board_free(board);
    board = board_new(flash, saves);
    board_link(board, true, 0);
    return board;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct board *first = begun(), *board = first;
    sequence = 0;
    for (size_t at = 0, took; (took = story_act_bytes(data + at, size - at)) != 0; at += took) {
        perform(board, data + at);
        check_replies(board);
        check_state(board);
        board = started(board, first);
    }
    if (board != first)
        board_free(board);
    return 0;
}
