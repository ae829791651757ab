#include "heat.h"

#define READ_EVERY_US 100000u
#define READINGS 16 /* of the smoothed mean */
#define HOUSING_READINGS 12u /* power of two: a charge decays to a third in 4096 readings, 6.8 minutes */
#define HOUSING_CHARGE ((uint64_t)HOUSING_MA * READ_EVERY_US << HOUSING_READINGS) /* what HOUSING_MA gathers in the end */

static int32_t degrees(int32_t celsius)
{
    return celsius * 10 * READINGS;
}

bool heat_due(const struct heat *heat, uint64_t now_us)
{
    return !heat->read_us || now_us - heat->read_us >= READ_EVERY_US;
}

static void smooth(int32_t *mean, bool first, int16_t temperature)
{
    *mean += first ? temperature * READINGS : temperature - *mean / READINGS;
}

static void feel_ring(struct heat *heat, int16_t ring)
{
    heat->ring_known = ring != NO_TEMPERATURE;
    if (heat->ring_known)
        smooth(&heat->ring_mean, !heat->ring_felt, ring);
    heat->ring_felt = heat->ring_felt || heat->ring_known;
}

void heat_draw(struct heat *heat, uint64_t now_us, uint16_t current_ma)
{
    if (now_us > heat->drawn_us) { /* a light may have been latched shortly before the last reading */
        heat->drawn += heat->drawing_ma * (uint32_t)(now_us - heat->drawn_us);
        heat->drawn_us = now_us;
    }
    heat->drawing_ma = current_ma;
}

/* Whether the housing gets too warm: too much was drawn for long, and still is. */
static bool gather(struct heat *heat, uint64_t now_us)
{
    uint32_t elapsed_us = (uint32_t)(now_us - heat->read_us);
    heat_draw(heat, now_us, heat->drawing_ma);
    bool much = heat->drawn > HOUSING_MA * elapsed_us;
    heat->charge += heat->drawn - (heat->charge >> HOUSING_READINGS);
    heat->drawn = 0;
    return much && heat->charge > HOUSING_CHARGE;
}

static bool ring_hot(const struct heat *heat)
{
    return heat->ring_known && heat->ring_mean > degrees((int32_t)RING_HOTTEST_C);
}

static bool ring_cool(const struct heat *heat)
{
    return heat->ring_known ? heat->ring_mean < degrees((int32_t)(RING_HOTTEST_C - COOLER_C)) : !heat->ring_felt;
}

bool heat_read(struct heat *heat, uint64_t now_us, int16_t chip, int16_t ring, uint8_t hottest_c)
{
    bool sensed = chip != NO_TEMPERATURE, hot = gather(heat, now_us);
    bool cool = heat->charge < HOUSING_CHARGE / 6u * 5u;
    smooth(&heat->mean, !heat->read_us, sensed ? chip : 0);
    feel_ring(heat, ring);
    heat->read_us = now_us ? now_us : 1u;
    hot = hot || ring_hot(heat) || (sensed && heat->mean > degrees(hottest_c));
    cool = cool && ring_cool(heat) && (!sensed || heat->mean < degrees((int32_t)hottest_c - (int32_t)COOLER_C));
    if (heat->dimmed && now_us - heat->dimmed_us < DIMMING_US)
        return false;
    if (!(hot && heat->dimmed < DIMMINGS) && !(cool && heat->dimmed))
        return false;
    heat->dimmed = (uint8_t)(hot ? heat->dimmed + 1u : heat->dimmed - 1u);
    heat->dimmed_us = now_us;
    return true;
}

int16_t heat_temperature(const struct heat *heat)
{
    return (int16_t)(heat->mean / READINGS);
}

int16_t heat_ring_temperature(const struct heat *heat)
{
    return heat->ring_known ? (int16_t)(heat->ring_mean / READINGS) : (int16_t)NO_TEMPERATURE;
}

uint16_t heat_mean_ma(const struct heat *heat)
{
    return (uint16_t)((uint32_t)(heat->charge >> HOUSING_READINGS) / READ_EVERY_US);
}
