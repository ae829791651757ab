/* From reset to main(): start the watchdog, raise the clock, copy the image to RAM, clear what starts at zero; and the vectors. */
#include "board.h"
#include "registers.h"

#include "bytes.h"

extern uint32_t stack_top, ram_start, ram_end, bss_start, bss_end;
extern const uint32_t ram_load;
int main(void);

/*
 * Runs from flash, before anything is in RAM; so it may call nothing that is not in flash. The clock goes before the
 * copy: LEDs that a reset left lit stay so until the image runs, and on the ring oscillator a word of flash takes 40 us.
 */
START_CODE __attribute__((noreturn, used)) void start(void)
{
    watchdog_start();
    clock_raise();
    const volatile uint32_t *from = &ram_load;
    for (volatile uint32_t *to = &ram_start; to < &ram_end;)
        *to++ = *from++;
    for (volatile uint32_t *to = &bss_start; to < &bss_end;)
        *to++ = 0;
    int (*volatile run)(void) = main; /* in RAM, too far for a direct call */
    run();
    for (;;)
        ;
}

typedef void (*vector)(void);

/* In force from the first instruction on: no interrupt is enabled yet, but a fault may come. */
__attribute__((section(".start_vectors"), used)) static const vector first[16] = {
    [0] = (vector)&stack_top,
    [1] = (vector)start,
    [2] = start_fault,
    [3] = start_fault,
    [11] = start_fault,
    [14] = start_fault,
    [15] = start_fault,
};

/* Filled in by the build: how many bytes follow, their CRC-32, and the family of the UF2 file. */
__attribute__((section(".image_header"), used)) const struct image_header image_header = {0x474c494d, 0, 0, 0};

__attribute__((section(".vectors"), used, aligned(256))) static const vector vectors[48] = {
    [0] = (vector)&stack_top,
    [1] = (vector)start,
    [2] = fault,
    [3] = fault,
    [11] = fault,
    [14] = fault,
    [15] = fault,
    [16 + IRQ_TIMER_0] = light_interrupt,
    [16 + IRQ_TIMER_1] = tick_interrupt,
    [16 + IRQ_TIMER_2] = pulse_interrupt,
    [16 + IRQ_TIMER_3] = join_interrupt,
    [16 + IRQ_USB] = usb_interrupt,
    [16 + IRQ_IO_BANK0] = trigger_interrupt,
};

void vectors_install(void)
{
    REGISTER(SCB_VTOR) = (uint32_t)vectors;
}
