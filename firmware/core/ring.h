/* Colours of the LEDs: their current, the limit, and the order of the wire. What lies behind the last LED is zero. */
#ifndef GELLIGHT_RING_H
#define GELLIGHT_RING_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* The current model: each LED draws quiescent_ua, and channel_ua * value / 255 for each of its colours. */
struct ring_limits {
    uint8_t led_count;
    uint16_t limit_ma;
    uint16_t quiescent_ua;
    uint16_t channel_ua;
    uint8_t hottest_c;
};

/* Take over the model and the limits; the number of LEDs stays what it was at the start. */
void ring_configure(struct ring_limits *limits, const struct configuration *configuration);

/* Let the LEDs draw no more, and get no hotter, than was granted. */
void ring_bound(struct ring_limits *limits, const struct ring_limits *granted);

uint32_t ring_current_ua(const struct ring_limits *limits, const uint8_t colours[COLOUR_BYTES]);
uint16_t ring_current_ma(const struct ring_limits *limits, const uint8_t colours[COLOUR_BYTES]);
uint16_t ring_ma(uint32_t current_ua); /* rounded up */

/* Whether the light needs no more than the limit: exactly where ring_current_ua() says so. */
bool ring_within(const struct ring_limits *limits, const uint8_t colours[COLOUR_BYTES]);

/* Halve every colour `halvings` times, rounded up: what is lit stays lit. */
void ring_dim(uint8_t halvings, uint8_t colours[COLOUR_BYTES]);

/* WS2812B takes green, red, blue (data sheet, "Composition of 24 bit data"); `order` is of enum colour_order. */
void ring_wire_order(uint8_t order, const uint8_t colours[COLOUR_BYTES], uint8_t wire[COLOUR_BYTES]);

/* How many bits an LED takes, and how long all of them take: 1.25 us a bit. */
uint32_t ring_bits(uint8_t order);
uint32_t ring_wire_us(uint8_t led_count, uint8_t order);

#endif
