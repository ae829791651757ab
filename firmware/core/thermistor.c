#include "thermistor.h"

#include "protocol.h"

#define FULL_READING 4096u
#define BETA_K 3380
#define T25 29815u /* 0.01 K */
#define ZERO_C 2732 /* 0.1 K: rounded up, and so is the temperature */
#define SCALE 16     /* of numerator and denominator, so that both fit 32 bits and a step is 0.005 K */
#define T25_LN2 3307 /* SCALE * 298.15 K * ln 2: what a doubling of R takes */

/* 65536 * log2: the place of the highest bit, then one bit more each time the rest, 1 to 2 in 15 bits, is squared. */
static int32_t log2_of(uint32_t value)
{
    int32_t places = 15, log = 0;
    for (; value < 1u << 15; value <<= 1)
        places--;
    for (uint32_t bit = 1u << 15; bit; bit >>= 1) {
        value = value * value >> 15;
        if (value >> 16) {
            value >>= 1;
            log += (int32_t)bit;
        }
    }
    return places * 65536 + log;
}

int16_t thermistor_temperature(uint16_t reading)
{
    if (reading <= THERMISTOR_SHORT || reading >= THERMISTOR_OPEN)
        return (int16_t)NO_TEMPERATURE;
    int32_t log = log2_of(reading) - log2_of(FULL_READING - reading); /* of R / R25: 5.4 doublings at most */
    uint32_t kelvin = SCALE * BETA_K * T25 / (uint32_t)(SCALE * BETA_K + T25_LN2 * log / 65536);
    return (int16_t)((int32_t)((kelvin + 10u) / 10u) - ZERO_C);
}
