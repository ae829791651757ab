/*
 * The LEDs get dimmer while the chip beside them is hot. The limit is in the configuration; above it each colour is
 * halved, and again every DIMMING_US for as long as it stays hot, down to an eighth. Below the limit by COOLER_C it goes
 * back by the same steps.
 */
#ifndef GELLIGHT_HEAT_H
#define GELLIGHT_HEAT_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

struct heat {
    int32_t mean;       /* sixteen times the temperature in 0.1 degrees, smoothed over a second or two */
    uint64_t read_us;   /* when the sensor was read last, 0: never */
    uint64_t dimmed_us; /* when `dimmed` changed last */
    uint8_t dimmed;     /* how often each colour is halved */
};

/* Whether the sensor is to be read now. */
bool heat_due(const struct heat *heat, uint64_t now_us);

/* Take a reading; true if `dimmed` has changed. */
bool heat_read(struct heat *heat, uint64_t now_us, int16_t temperature, uint8_t hottest_c);

/* Of the chip, smoothed, in 0.1 degrees. */
int16_t heat_temperature(const struct heat *heat);

#endif
