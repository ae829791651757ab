/*
 * One fuzz input is a story told to the virtual board: a list of acts, each a byte for what and a byte for how much.
 *
 *   0 n       let n * 1009 us pass          4 n       the port closes (n even) or opens (n odd)
 *   1 n ...   n bytes of rubbish            5 n       n & 4: the host takes no bytes, until the next such act
 *   2 n ...   a request: type, payload of n 6 n       COMMIT the first (n & 31) + 1 steps, n >> 6 times over
 *   3 n       an edge of the trigger pin,   7 n       the chip has n degrees Celsius from now on; from 224 on: the
 *             falling if n is odd                     converter reads (n - 224) * 128 + 63 of the ring's NTC
 *
 * A board that restarts has its port open again.
 *
 * COMMIT is an act of its own because no fuzzer guesses the checksum of a table.
 */
#ifndef GELLIGHT_STORY_H
#define GELLIGHT_STORY_H

#include <stddef.h>
#include <stdint.h>

#include "packet.h"

enum act {
    ACT_TIME = 0,
    ACT_RUBBISH = 1,
    ACT_REQUEST = 2,
    ACT_TRIGGER = 3,
    ACT_LINK = 4,
    ACT_FAULT = 5,
    ACT_COMMIT = 6,
    ACT_HEAT = 7,
};
#define ACTS 8u
#define HEAT_RING 224u

static inline uint32_t story_reading(uint32_t amount)
{
    return (amount - HEAT_RING) * 128u + 63u;
}

/* How many bytes the first act of what is left takes; 0: it is not whole, the story ends. */
static inline size_t story_act_bytes(const uint8_t *act, size_t left)
{
    size_t count = 2;
    if (left < 2)
        return 0;
    if (act[0] % ACTS == ACT_RUBBISH)
        count += act[1];
    if (act[0] % ACTS == ACT_REQUEST)
        count += 1u + act[1];
    return count > left || (act[0] % ACTS == ACT_REQUEST && act[1] > PACKET_PAYLOAD_BYTES) ? 0 : count;
}

#endif
