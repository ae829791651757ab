#include "heat.h"

#define READ_EVERY_US 100000u
#define READINGS 16 /* of the smoothed mean */

static int32_t degrees(int32_t celsius)
{
    return celsius * 10 * READINGS;
}

bool heat_due(const struct heat *heat, uint64_t now_us)
{
    return !heat->read_us || now_us - heat->read_us >= READ_EVERY_US;
}

static void smooth(struct heat *heat, uint64_t now_us, int16_t temperature)
{
    heat->mean += heat->read_us ? temperature - heat->mean / READINGS : temperature * READINGS;
    heat->read_us = now_us ? now_us : 1u;
}

bool heat_read(struct heat *heat, uint64_t now_us, int16_t temperature, uint8_t hottest_c)
{
    if (temperature == NO_TEMPERATURE)
        return false;
    smooth(heat, now_us, temperature);
    bool hot = heat->mean > degrees(hottest_c), cool = heat->mean < degrees((int32_t)hottest_c - (int32_t)COOLER_C);
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
