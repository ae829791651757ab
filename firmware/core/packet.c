#include "packet.h"

#include "bytes.h"
#include "crc.h"

_Static_assert(PACKET_BYTES < 254, "one COBS code is enough for a whole packet without zeros");

void packet_reset(struct packet_receiver *receiver)
{
    receiver->count = 0;
    receiver->overflow = false;
}

/* Undo COBS in place; returns the number of bytes, or 0 if the codes do not add up. */
static size_t unstuff(uint8_t *bytes, size_t count)
{
    size_t in = 0, out = 0;
    while (in < count) {
        size_t code = bytes[in++];
        if (code - 1 > count - in)
            return 0;
        for (size_t i = 1; i < code; i++)
            bytes[out++] = bytes[in++];
        if (in < count)
            bytes[out++] = 0;
    }
    return out;
}

static enum packet_result unpack(uint8_t *bytes, size_t stuffed, struct packet *packet)
{
    size_t count = unstuff(bytes, stuffed);
    if (count < 4 || count > PACKET_BYTES)
        return PACKET_BAD_FRAMING;
    if (crc16(bytes, count - 2) != (bytes[count - 2] | bytes[count - 1] << 8))
        return PACKET_BAD_CRC;
    packet->type = bytes[0];
    packet->sequence = bytes[1];
    packet->count = (uint8_t)(count - 4);
    bytes_copy(packet->payload, bytes + 2, packet->count);
    return PACKET_COMPLETE;
}

enum packet_result packet_receive(struct packet_receiver *receiver, uint8_t byte, struct packet *packet)
{
    enum packet_result result = PACKET_NONE;
    if (byte) {
        if (receiver->count < sizeof receiver->bytes)
            receiver->bytes[receiver->count++] = byte;
        else
            receiver->overflow = true;
        return PACKET_NONE;
    }
    if (receiver->overflow)
        result = PACKET_OVERSIZE;
    else if (receiver->count)
        result = unpack(receiver->bytes, receiver->count, packet);
    packet_reset(receiver);
    return result;
}

size_t packet_encode(const struct packet *packet, uint8_t wire[PACKET_WIRE_BYTES])
{
    uint8_t body[PACKET_BYTES];
    size_t count = packet->count + 2u;
    body[0] = packet->type;
    body[1] = packet->sequence;
    bytes_copy(body + 2, packet->payload, packet->count);
    uint16_t crc = crc16(body, count);
    body[count++] = (uint8_t)crc;
    body[count++] = (uint8_t)(crc >> 8);

    size_t code = 0, out = 1;
    for (size_t i = 0; i < count; i++) {
        if (body[i]) {
            wire[out++] = body[i];
            continue;
        }
        wire[code] = (uint8_t)(out - code);
        code = out++;
    }
    wire[code] = (uint8_t)(out - code);
    wire[out++] = 0;
    return out;
}
