/* The pins besides that of the LEDs: the trigger's input, the trigger output, the status LED, the load switch. */
#include "board.h"
#include "registers.h"

#define PULSE_US 100u
#define SLOW_US 500000u /* half a period of the status LED without a host */
#define FAST_US 100000u /* and after a fault */
#define BOTH_EDGES 0xcu

static uint32_t trigger_pin, output, status, load_switch; /* all but the first as bits, 0: there is none */
static bool status_low, switch_low;                       /* what lights, or closes, when low */
static volatile bool pulsing;

static uint32_t prepare_output(uint8_t pin, bool high)
{
    if (pin == NO_PIN)
        return 0;
    REGISTER(high ? SIO_OUT_SET : SIO_OUT_CLEAR) = 1u << pin;
    REGISTER(SIO_ENABLE_SET) = 1u << pin;
    REGISTER(PADS_BANK0(pin)) = PAD_OUTPUT;
    REGISTER(IO_BANK0_CTRL(pin)) = FUNCTION_SIO;
    return 1u << pin;
}

/* Off: high where `low` switches on. */
static uint32_t prepare_switch(uint8_t pin, bool *low)
{
    *low = pin != NO_PIN && pin & ACTIVE_LOW;
    return prepare_output(*low ? (uint8_t)(pin - ACTIVE_LOW) : pin, *low);
}

void pins_power(void *context, bool closed)
{
    (void)context;
    REGISTER(closed != switch_low ? SIO_OUT_SET : SIO_OUT_CLEAR) = load_switch;
}

void pins_setup(const struct configuration *configuration)
{
    trigger_pin = configuration->trigger_pin;
    REGISTER(PADS_BANK0(trigger_pin)) = PAD_PULLED_UP;
    REGISTER(IO_BANK0_CTRL(trigger_pin)) = FUNCTION_SIO;
    REGISTER(NVIC_ISER) = 1u << IRQ_IO_BANK0;
    output = prepare_output(configuration->output_pin, false);
    status = prepare_switch(configuration->status_pin, &status_low);
    load_switch = prepare_switch(configuration->switch_pin, &switch_low);
}

void pins_listen(void *context, bool enabled, bool falling)
{
    (void)context;
    uint32_t shift = 4u * (trigger_pin % 8u);
    pins_acknowledge();
    REGISTER(IO_BANK0_PROC0_INTE(trigger_pin)) = enabled ? (falling ? 4u : 8u) << shift : 0;
}

void pins_acknowledge(void)
{
    REGISTER(IO_BANK0_INTR(trigger_pin)) = BOTH_EDGES << 4u * (trigger_pin % 8u);
}

/* ---- the trigger output, by alarm 2 ---- */

static void pulse_begin(void)
{
    REGISTER(SIO_OUT_SET) = output;
    pulsing = true;
    REGISTER(TIMER_ALARM(2)) = REGISTER(TIMER_TIMERAWL) + PULSE_US;
}

void pins_pulse(uint32_t after_us)
{
    REGISTER(TIMER_ARMED) = 1u << 2;
    REGISTER(TIMER_INTR) = 1u << 2; /* also one that fires at this moment */
    REGISTER(NVIC_ICPR) = 1u << IRQ_TIMER_2;
    REGISTER(SIO_OUT_CLEAR) = output;
    pulsing = false;
    if (!output || after_us == PORT_NO_PULSE)
        return;
    if (after_us > 2u)
        REGISTER(TIMER_ALARM(2)) = REGISTER(TIMER_TIMERAWL) + after_us;
    else
        pulse_begin();
}

/* The light's interrupt goes before this one, and may have taken its pulse away, or set the alarm for another. */
void pulse_interrupt(void)
{
    uint32_t interrupts = interrupts_off();
    bool due = REGISTER(TIMER_INTR) & 1u << 2;
    REGISTER(TIMER_INTR) = 1u << 2;
    if (due && pulsing)
        REGISTER(SIO_OUT_CLEAR) = output;
    else if (due)
        pulse_begin();
    interrupts_restore(interrupts);
}

/* ---- the status LED: fast after a fault, steady while a host has the port open, slow without one ---- */

static bool failed(const struct controller *controller)
{
    uint8_t reason = controller->port->identity.reset_reason;
    bool restarted = reason == RESET_REASON_WATCHDOG || reason == RESET_REASON_FAULT;
    return controller->dark == DARK_FAULT || (restarted && !controller->counters.packets);
}

void status_show(const struct controller *controller)
{
    uint32_t half_us = failed(controller) ? FAST_US : SLOW_US;
    bool steady = controller->open && !failed(controller);
    bool on = steady || REGISTER(TIMER_TIMERAWL) / half_us % 2u == 0;
    REGISTER(on != status_low ? SIO_OUT_SET : SIO_OUT_CLEAR) = status;
}
