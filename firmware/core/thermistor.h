/*
 * The temperature of the ring: an NTC of 10 kohm (at 25 degrees) between an input of the converter and ground, and a resistor
 * of 10 kohm from that input to full scale.
 *
 * A reading x, 0 to 4095 of 4096, is R = 10 kohm * x / (4096 - x). By the beta equation (IEC 60539-1), in kelvin,
 *
 *     1 / T = 1 / T25 + ln(R / R25) / B      so      T = T25 * B / (B + T25 * ln(R / R25))
 *
 * with B = 3380 K (25 to 50 degrees; Murata NCP18XH103F03RB) it is within 1 degree of the maker's table from 0 to 80 degrees, and 0.3
 * too warm at 60. The parts, 1 % each, add 0.7 degrees there.
 */
#ifndef GELLIGHT_THERMISTOR_H
#define GELLIGHT_THERMISTOR_H

#include <stdint.h>

#define THERMISTOR_OPEN 3990u  /* from here on the wire is broken: 376 kohm would be -50 degrees */
#define THERMISTOR_SHORT 100u  /* up to here it is short: 250 ohm would be 160 degrees */

/* In 0.1 degrees Celsius; NO_TEMPERATURE of one that is open or short. */
int16_t thermistor_temperature(uint16_t reading);

#endif
