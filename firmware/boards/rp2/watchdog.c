/* The hardware watchdog, restarts, and what happens when the processor runs into a fault. */
#include "board.h"
#include "registers.h"

#define TIMEOUT_US 100000u
#define START_US 200000u /* for the crystal and the copy to RAM */
#define REASON_MAGIC 0x52450000u
#define NOTED_SAVES 0xf00u /* outlive every restart but that of the boot ROM, where the host may write the flash anyway */

/*
 * SCRATCH0 says why the chip will start the next time, as far as is known now; SCRATCH1 why it has started. The boot ROM
 * restarts the chip by the watchdog too (2.8.4), after a flash for instance, but leaves no note: somebody has asked for it.
 */
uint8_t watchdog_reset_reason(void)
{
    uint32_t note = REGISTER(WATCHDOG_SCRATCH1);
    if (!REGISTER(WATCHDOG_REASON))
        return RESET_REASON_POWER;
    return (note & 0xffff0000u) == REASON_MAGIC ? (uint8_t)note : RESET_REASON_COMMAND;
}

uint8_t watchdog_saves(void)
{
    return REGISTER(WATCHDOG_REASON) ? (REGISTER(WATCHDOG_SCRATCH0) & NOTED_SAVES) >> 8 : 0;
}

void watchdog_note_saves(void *context, uint8_t saves)
{
    (void)context;
    REGISTER(WATCHDOG_SCRATCH0) = (REGISTER(WATCHDOG_SCRATCH0) & ~NOTED_SAVES) | (uint32_t)saves << 8;
}

static inline __attribute__((always_inline)) void note_reason(uint32_t reason)
{
    REGISTER(WATCHDOG_SCRATCH0) = (REGISTER(WATCHDOG_SCRATCH0) & NOTED_SAVES) | REASON_MAGIC | reason;
}

void watchdog_forget(void)
{
    REGISTER(WATCHDOG_SCRATCH0) = 0;
}

/*
 * From flash, before the clock is raised. On the ring oscillator (1.8 to 12 MHz, 2.17) the tick is longer than 1 us, never
 * shorter.
 */
START_CODE void watchdog_start(void)
{
    REGISTER(WATCHDOG_SCRATCH1) = REGISTER(WATCHDOG_SCRATCH0);
    note_reason(RESET_REASON_WATCHDOG);
    REGISTER(PSM_WDSEL) = EVERYTHING_BUT_OSCILLATORS;
    ticks_start();
    REGISTER(WATCHDOG_LOAD) = WATCHDOG_COUNTS_A_US * START_US;
    SET_BITS(WATCHDOG_CTRL) = 1u << 30;
}

void watchdog_feed(void)
{
    REGISTER(WATCHDOG_LOAD) = WATCHDOG_COUNTS_A_US * TIMEOUT_US;
}

/* An erase takes up to 400 ms, by the data sheets of the usual flash chips; 24 bits last 8.3 s or more. */
void watchdog_pause(void)
{
    REGISTER(WATCHDOG_LOAD) = 0xffffffu;
}

/* A fault before the image is in RAM: nothing can be darkened yet, only started anew. */
START_CODE void start_fault(void)
{
    REGISTER(PSM_WDSEL) = EVERYTHING_BUT_OSCILLATORS;
    note_reason(RESET_REASON_FAULT);
    SET_BITS(WATCHDOG_CTRL) = 1u << 31;
    for (;;)
        ;
}

void watchdog_restart(uint8_t reason)
{
    REGISTER(PSM_WDSEL) = EVERYTHING_BUT_OSCILLATORS;
    note_reason(reason);
    SET_BITS(WATCHDOG_CTRL) = 1u << 31;
    for (;;)
        ;
}

void fault(void)
{
    interrupts_off();
    pins_power(NULL, false);
    light_force_dark();
    watchdog_restart(RESET_REASON_FAULT);
}
