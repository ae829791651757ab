/* The registers of the RP2040 that this firmware uses, by the names of its data sheet (build 2024-10-15). */
#ifndef GELLIGHT_REGISTERS_H
#define GELLIGHT_REGISTERS_H

#include "common_registers.h"

#define THIS_BOARD BOARD_KIND_RP2040

#define SYSINFO_CHIP_ID 0x40000000u

#define SSI_BASE 0x18000000u
#define SSI_CTRLR0 (SSI_BASE + 0x00u)
#define SSI_SSIENR (SSI_BASE + 0x08u)
#define SSI_SER (SSI_BASE + 0x10u)
#define SSI_BAUDR (SSI_BASE + 0x14u)
#define SSI_SR (SSI_BASE + 0x28u)
#define SSI_DR0 (SSI_BASE + 0x60u)

#define CLK_REF_CTRL 0x40008030u
#define CLK_REF_SELECTED 0x40008038u
#define CLK_SYS_CTRL 0x4000803cu
#define CLK_SYS_SELECTED 0x40008044u
#define CLK_PERI_CTRL 0x40008048u
#define CLK_USB_CTRL 0x40008054u
#define CLK_ADC_CTRL 0x40008060u
#define CLK_SYS_RESUS_CTRL 0x40008078u

#define RESETS_RESET 0x4000c000u
#define RESETS_DONE 0x4000c008u
#define RESET_ADC (1u << 0)
#define RESET_DMA (1u << 2)
#define RESET_IO_BANK0 (1u << 5)
#define RESET_PADS_BANK0 (1u << 8)
#define RESET_PIO0 (1u << 10)
#define RESET_PLL_SYS (1u << 12)
#define RESET_PLL_USB (1u << 13)
#define RESET_TIMER (1u << 21)
#define RESET_USBCTRL (1u << 24)

#define IO_BANK0_CTRL(pin) (0x40014004u + 8u * (pin))
#define IO_BANK0_INTR(pin) (0x400140f0u + 4u * ((pin) / 8u)) /* four bits a pin */
#define IO_BANK0_PROC0_INTE(pin) (0x40014100u + 4u * ((pin) / 8u))
#define IO_QSPI_SS_CTRL 0x4001800cu
#define PADS_BANK0(pin) (0x4001c004u + 4u * (pin))

#define PAD_BUS_KEEP (1u << 3 | 1u << 2) /* both pulls, in addition */
#define FUNCTION_USB 8u
#define PIN_OUTPUT_OFF (2u << 12)
#define PIN_INPUT_HIGH (3u << 16)

#define XOSC_CTRL 0x40024000u
#define XOSC_STATUS 0x40024004u
#define XOSC_STARTUP 0x4002400cu
#define PLL_SYS_BASE 0x40028000u
#define PLL_USB_BASE 0x4002c000u

#define ADC_CS 0x4004c000u
#define ADC_RESULT 0x4004c004u

#define TIMER_ALARM(n) (0x40054010u + 4u * (n))
#define TIMER_ARMED 0x40054020u
#define TIMER_TIMERAWH 0x40054024u
#define TIMER_TIMERAWL 0x40054028u
#define TIMER_INTR 0x40054034u
#define TIMER_INTE 0x40054038u

#define WATCHDOG_CTRL 0x40058000u
#define WATCHDOG_LOAD 0x40058004u
#define WATCHDOG_REASON 0x40058008u
#define WATCHDOG_SCRATCH0 0x4005800cu
#define WATCHDOG_SCRATCH1 0x40058010u
#define WATCHDOG_TICK 0x4005802cu
#define PSM_WDSEL 0x40010008u
#define EVERYTHING_BUT_OSCILLATORS 0x0001fffcu
#define WATCHDOG_COUNTS_A_US 2u /* it falls twice a tick (RP2040-E1) */

#define DMA_READ_ADDR 0x50000000u
#define DMA_WRITE_ADDR 0x50000004u
#define DMA_TRANS_COUNT 0x50000008u
#define DMA_CTRL_TRIG 0x5000000cu
#define DMA_AL1_CTRL 0x50000010u
#define DMA_MULTI_CHAN_TRIGGER 0x50000430u
#define DMA_CHAN_ABORT 0x50000444u
#define DMA_CHAIN(channel) ((channel) << 11)
#define DMA_PACED_BY(request) ((request) << 15)
#define DMA_QUIET (1u << 21)
#define DMA_BUSY (1u << 24)

#define SIO_OUT_SET 0xd0000014u
#define SIO_OUT_CLEAR 0xd0000018u
#define SIO_ENABLE_SET 0xd0000024u

#define IRQ_USB 5u
#define IRQ_IO_BANK0 13u

/* The tick of watchdog and timer is 1 us once clk_ref is the crystal. */
static inline __attribute__((always_inline)) void ticks_start(void)
{
    REGISTER(WATCHDOG_TICK) = 1u << 9 | 12;
}

#endif
