#include "ring.h"

void ring_configure(struct ring_limits *limits, const struct configuration *configuration)
{
    limits->limit_ma = configuration->limit_ma;
    limits->quiescent_ua = configuration->quiescent_ua;
    limits->channel_ua = configuration->channel_ua;
    limits->hottest_c = configuration->hottest_c;
}

void ring_bound(struct ring_limits *limits, const struct ring_limits *granted)
{
    if (limits->limit_ma > granted->limit_ma)
        limits->limit_ma = granted->limit_ma;
    if (limits->quiescent_ua < granted->quiescent_ua)
        limits->quiescent_ua = granted->quiescent_ua;
    if (limits->channel_ua < granted->channel_ua)
        limits->channel_ua = granted->channel_ua;
    if (limits->hottest_c > granted->hottest_c)
        limits->hottest_c = granted->hottest_c;
}

static uint32_t sum(const struct ring_limits *limits, const uint8_t colours[COLOUR_BYTES])
{
    uint32_t total = 0;
    for (uint32_t i = 0; i < 3u * limits->led_count; i++)
        total += colours[i];
    return total;
}

/* At most 72 * 255 * 60000 = 1,101,600,000: fits 32 bits. Rounded up, so that the model never says too little. */
static uint32_t channels_ua(const struct ring_limits *limits, uint32_t values)
{
    return (values * limits->channel_ua + 254u) / 255u;
}

static uint32_t quiescent_ua(const struct ring_limits *limits)
{
    return (uint32_t)limits->led_count * limits->quiescent_ua;
}

uint32_t ring_current_ua(const struct ring_limits *limits, const uint8_t colours[COLOUR_BYTES])
{
    return quiescent_ua(limits) + channels_ua(limits, sum(limits, colours));
}

uint16_t ring_ma(uint32_t current_ua)
{
    return (uint16_t)((current_ua + 999u) / 1000u);
}

uint16_t ring_current_ma(const struct ring_limits *limits, const uint8_t colours[COLOUR_BYTES])
{
    return ring_ma(ring_current_ua(limits, colours));
}

/* Without a division: a processor that has none would spend most of a sequence's time on it. */
bool ring_within(const struct ring_limits *limits, const uint8_t colours[COLOUR_BYTES])
{
    uint32_t limit_ua = limits->limit_ma * 1000u;
    return quiescent_ua(limits) <= limit_ua &&
           sum(limits, colours) * limits->channel_ua <= (limit_ua - quiescent_ua(limits)) * 255u;
}

void ring_dim(uint8_t halvings, uint8_t colours[COLOUR_BYTES])
{
    for (uint32_t i = 0; halvings && i < COLOUR_BYTES; i++)
        colours[i] = (uint8_t)((colours[i] + (1u << halvings) - 1u) >> halvings);
}

void ring_wire_order(uint8_t order, const uint8_t colours[COLOUR_BYTES], uint8_t wire[COLOUR_BYTES])
{
    uint32_t red = order == COLOUR_ORDER_RGB ? 0 : 1;
    for (uint32_t i = 0; i < COLOUR_BYTES; i += 3) {
        wire[i + red] = colours[i];
        wire[i + 1u - red] = colours[i + 1];
        wire[i + 2] = colours[i + 2];
    }
}

uint32_t ring_bits(uint8_t order)
{
    return order == COLOUR_ORDER_RGBW ? 32 : 24;
}

uint32_t ring_wire_us(uint8_t led_count, uint8_t order)
{
    return led_count * ring_bits(order) * 5u / 4u;
}
