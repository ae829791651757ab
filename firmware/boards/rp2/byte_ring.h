/*
 * Bytes between an interrupt and the main loop: one side puts, the other gets. The bytes are volatile too, because the
 * compiler may move other accesses past those of head and tail; the processor itself keeps their order.
 */
#ifndef GELLIGHT_BYTE_RING_H
#define GELLIGHT_BYTE_RING_H

#include <stdint.h>

#define RING_BYTES 1024u /* a power of two */

struct byte_ring {
    volatile uint8_t bytes[RING_BYTES];
    volatile uint32_t head, tail; /* count up for ever; their difference is what is in the ring */
};

static inline uint32_t ring_count(const struct byte_ring *ring)
{
    return ring->head - ring->tail;
}

static inline void ring_put(struct byte_ring *ring, uint8_t byte)
{
    ring->bytes[ring->head % RING_BYTES] = byte;
    ring->head++;
}

static inline void ring_empty(struct byte_ring *ring)
{
    ring->tail = ring->head;
}

static inline uint8_t ring_get(struct byte_ring *ring)
{
    uint8_t byte = ring->bytes[ring->tail % RING_BYTES];
    ring->tail++;
    return byte;
}

#endif
