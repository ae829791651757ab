/*
 * Packets: COBS framing and CRC-16.
 *
 *   wire    | COBS code, bytes without zero ... | 0x00 |
 *   decoded | type u8 | sequence u8 | payload ... | CRC-16 u16 |     4 to PACKET_BYTES bytes
 */
#ifndef GELLIGHT_PACKET_H
#define GELLIGHT_PACKET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "protocol.h"

#define PACKET_PAYLOAD_BYTES (PACKET_BYTES - 4u)
#define PACKET_WIRE_BYTES (PACKET_BYTES + 2u) /* one COBS code and the zero; no packet needs a second code */

struct packet {
    uint8_t type;
    uint8_t sequence;
    uint8_t count; /* of the payload */
    uint8_t payload[PACKET_PAYLOAD_BYTES];
};

enum packet_result {
    PACKET_NONE, /* not complete yet */
    PACKET_COMPLETE,
    PACKET_BAD_FRAMING,
    PACKET_BAD_CRC,
    PACKET_OVERSIZE,
};

struct packet_receiver {
    uint8_t bytes[PACKET_WIRE_BYTES - 1u];
    uint8_t count;
    bool overflow;
};

void packet_reset(struct packet_receiver *receiver);
enum packet_result packet_receive(struct packet_receiver *receiver, uint8_t byte, struct packet *packet);

/* Write the bytes for the wire and return how many there are. */
size_t packet_encode(const struct packet *packet, uint8_t wire[PACKET_WIRE_BYTES]);

#endif
