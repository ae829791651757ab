/* The converter: the sensor of the chip, and the NTC of the ring at THERMISTOR_PIN, which the board's `board.toml` names. */
#include "board.h"
#include "registers.h"
#include "thermistor.h"

#define FIRST_INPUT 26u /* GPIO26 to 29 are channels 0 to 3, the sensor of the chip is channel 4 (RP2040 4.9, RP2350 12.4) */
#define CHIP_CHANNEL 4u
#define FITTED (THERMISTOR_PIN >= FIRST_INPUT && THERMISTOR_PIN < FIRST_INPUT + CHIP_CHANNEL)

static bool unused; /* the pin has another use */
static bool pulled; /* as the last reading left the pad */
static uint16_t reading;

static uint16_t convert(uint32_t channel)
{
    REGISTER(ADC_CS) = channel << 12 | 1u << 2 | 1u << 1 | 1u << 0; /* one conversion, 2 us; the sensor has power */
    while (!(REGISTER(ADC_CS) & 1u << 8))
        ;
    return (uint16_t)(REGISTER(ADC_RESULT) & 0xfffu);
}

/* 27 degrees at 0.706 V, 1.721 mV less for each degree more, 3.3 V are 4096 (4.9.5): 437.2 - 0.46814 degrees a count. */
int16_t chip_temperature(void *context)
{
    (void)context;
    return (int16_t)(4372 - (int32_t)(convert(CHIP_CHANNEL) * 76699u >> 14));
}

static void pull(bool up)
{
    pulled = up;
    REGISTER(PADS_BANK0(THERMISTOR_PIN)) = up ? PAD_ANALOG_PULLED_UP : PAD_ANALOG;
}

/* After all other pins are set up. */
void thermistor_setup(void)
{
    unused = !FITTED || (REGISTER(IO_BANK0_CTRL(THERMISTOR_PIN)) & FUNCTION_NONE) != FUNCTION_NONE;
    reading = THERMISTOR_OPEN;
    if (!unused)
        pull(true);
}

/*
 * An input with nothing at it reads anything. So every other reading, 0.1 s apart, is taken against the pull-up of the pad (50
 * to 80 kohm), which brings such an input to full scale, and tells that alone; what is measured is measured without it.
 */
uint16_t thermistor_read(void *context)
{
    (void)context;
    if (unused)
        return THERMISTOR_OPEN;
    uint16_t now = convert(THERMISTOR_PIN - FIRST_INPUT);
    if (!pulled || now >= THERMISTOR_OPEN)
        reading = now;
    pull(!pulled || now >= THERMISTOR_OPEN);
    return reading;
}
