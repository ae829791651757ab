/*
 * The registers of the RP2350 that this firmware uses, with the sections of its data sheet (build 2025-02-20, compared with
 * its table of contents). The addresses were compared with the register headers of Raspberry Pi's pico-sdk; no chip has
 * confirmed them yet.
 */
#ifndef GELLIGHT_REGISTERS_H
#define GELLIGHT_REGISTERS_H

#include "common_registers.h"

#define THIS_BOARD BOARD_KIND_RP2350

/* Clocks (8.1) */
#define CLK_REF_CTRL 0x40010030u
#define CLK_REF_SELECTED 0x40010038u
#define CLK_SYS_CTRL 0x4001003cu
#define CLK_SYS_SELECTED 0x40010044u
#define CLK_PERI_CTRL 0x40010048u
#define CLK_USB_CTRL 0x40010060u
#define CLK_ADC_CTRL 0x4001006cu
#define CLK_SYS_RESUS_CTRL 0x40010084u

/* Resets (7.5) */
#define RESETS_RESET 0x40020000u
#define RESETS_DONE 0x40020008u
#define RESET_ADC (1u << 0)
#define RESET_DMA (1u << 2)
#define RESET_IO_BANK0 (1u << 6)
#define RESET_PADS_BANK0 (1u << 9)
#define RESET_PIO0 (1u << 11)
#define RESET_PLL_SYS (1u << 14)
#define RESET_PLL_USB (1u << 15)
#define RESET_TIMER (1u << 23)
#define RESET_USBCTRL (1u << 28)

/* Pins (9.11); a pad is isolated after a reset (bit 8) until it is written (9.7) */
#define IO_BANK0_CTRL(pin) (0x40028004u + 8u * (pin))
#define IO_BANK0_INTR(pin) (0x40028230u + 4u * ((pin) / 8u)) /* four bits a pin */
#define IO_BANK0_PROC0_INTE(pin) (0x40028248u + 4u * ((pin) / 8u))
#define PADS_BANK0(pin) (0x40038004u + 4u * (pin))

/* Crystal (8.2), PLLs (8.6) */
#define XOSC_CTRL 0x40048000u
#define XOSC_STATUS 0x40048004u
#define XOSC_STARTUP 0x4004800cu
#define PLL_SYS_BASE 0x40050000u
#define PLL_USB_BASE 0x40058000u

/* Converter (12.4): the sensor is channel 4 of the chip in the small package, which the Pico 2 has */
#define ADC_CS 0x400a0000u
#define ADC_RESULT 0x400a0004u

/* Timer 0 (12.8) */
#define TIMER_ALARM(n) (0x400b0010u + 4u * (n))
#define TIMER_ARMED 0x400b0020u
#define TIMER_TIMERAWH 0x400b0024u
#define TIMER_TIMERAWL 0x400b0028u
#define TIMER_INTR 0x400b003cu
#define TIMER_INTE 0x400b0040u

/* Watchdog (12.9), ticks (8.5), power-on state machine (7.4) */
#define WATCHDOG_CTRL 0x400d8000u
#define WATCHDOG_LOAD 0x400d8004u
#define WATCHDOG_REASON 0x400d8008u
#define WATCHDOG_SCRATCH0 0x400d800cu
#define WATCHDOG_SCRATCH1 0x400d8010u
#define TICKS_TIMER0_CTRL 0x40108018u
#define TICKS_TIMER0_CYCLES 0x4010801cu
#define TICKS_WATCHDOG_CTRL 0x40108030u
#define TICKS_WATCHDOG_CYCLES 0x40108034u
#define PSM_WDSEL 0x40018008u
#define EVERYTHING_BUT_OSCILLATORS 0x01fffff3u
#define WATCHDOG_COUNTS_A_US 1u

/* DMA (12.6) */
#define DMA_READ_ADDR 0x50000000u
#define DMA_WRITE_ADDR 0x50000004u
#define DMA_TRANS_COUNT 0x50000008u
#define DMA_CTRL_TRIG 0x5000000cu
#define DMA_AL1_CTRL 0x50000010u
#define DMA_MULTI_CHAN_TRIGGER 0x50000450u
#define DMA_CHAN_ABORT 0x50000464u
#define DMA_CHAIN(channel) ((channel) << 13)
#define DMA_PACED_BY(request) ((request) << 17)
#define DMA_QUIET (1u << 23)
#define DMA_BUSY (1u << 26)

/* Single-cycle IO (3.1.11) */
#define SIO_OUT_SET 0xd0000018u
#define SIO_OUT_CLEAR 0xd0000020u
#define SIO_ENABLE_SET 0xd0000038u

/* Interrupts (3.2) */
#define IRQ_USB 14u
#define IRQ_IO_BANK0 21u

/* Watchdog and timer have a tick each, of 1 us once clk_ref is the crystal. */
static inline __attribute__((always_inline)) void ticks_start(void)
{
    REGISTER(TICKS_TIMER0_CYCLES) = 12;
    REGISTER(TICKS_TIMER0_CTRL) = 1;
    REGISTER(TICKS_WATCHDOG_CYCLES) = 12;
    REGISTER(TICKS_WATCHDOG_CTRL) = 1;
}

#endif
