/*
 * The LEDs get dimmer while the chip or the ring is hot, or while they have drawn more than HOUSING_MA in the mean of the
 * last minutes, for a ring without an NTC. The limit of the chip is in the configuration, that of the ring is
 * RING_HOTTEST_C. Above any of them each colour is halved, and again every DIMMING_US for as long as that lasts, down to an
 * eighth. Below the limits by COOLER_C, and HOUSING_MA by a sixth, it goes back by the same steps; not while an NTC that was
 * felt since the start is lost, for then nothing tells that the ring has cooled.
 */
#ifndef GELLIGHT_HEAT_H
#define GELLIGHT_HEAT_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

struct heat {
    int32_t mean;       /* sixteen times the temperature in 0.1 degrees, smoothed over a second or two */
    int32_t ring_mean;  /* the same of the ring */
    bool ring_felt;     /* since the start */
    bool ring_known;    /* at the last reading */
    uint64_t read_us;   /* when the sensor was read last, 0: never */
    uint64_t dimmed_us; /* when `dimmed` changed last */
    uint8_t dimmed;     /* how often each colour is halved */
    uint16_t drawing_ma;
    uint64_t drawn_us; /* until when what was drawn is in `drawn` */
    uint32_t drawn;    /* since the last reading, mA us */
    uint64_t charge;   /* mA us; of what was drawn some minutes ago a share, see HOUSING_READINGS */
};

/* The LEDs draw this from now on. */
void heat_draw(struct heat *heat, uint64_t now_us, uint16_t current_ma);

/* Whether the sensor is to be read now. */
bool heat_due(const struct heat *heat, uint64_t now_us);

/* Take a reading of the chip and one of the ring, either NO_TEMPERATURE; true if `dimmed` has changed. */
bool heat_read(struct heat *heat, uint64_t now_us, int16_t chip, int16_t ring, uint8_t hottest_c);

/* Of the chip, smoothed, in 0.1 degrees. */
int16_t heat_temperature(const struct heat *heat);

/* Of the ring, as above; NO_TEMPERATURE where it is not known. */
int16_t heat_ring_temperature(const struct heat *heat);

/* What the LEDs draw in the mean. */
uint16_t heat_mean_ma(const struct heat *heat);

#endif
