/*
 * Clocks, all from the crystal of 12 MHz: PLL_SYS 1440 MHz / 6 / 2 = 120 MHz for the processor, PLL_USB 1200 MHz / 5 / 5 =
 * 48 MHz for USB and the ADC. A PLL's oscillator has to run at 750 to 1600 MHz (2.18), the processor at 1.1 times clk_usb
 * at least (RP2040-E16: a SETUP may be lost), and the PIO reaches the 12 MHz of the WS2812B waveform by the whole divider
 * 10, so without jitter.
 */
#include "board.h"
#include "registers.h"

#define TICK_US 10000u
#define CRYSTAL_DELAY 3000u /* 64 ms in units of 256 cycles (2.16.3): what slow crystals of some boards need */

static volatile bool passed;

START_CODE static void wait_for(uint32_t address, uint32_t bits)
{
    while ((REGISTER(address) & bits) != bits)
        ;
}

/* The watchdog does not stop the crystal: after it no time is lost, so that the LEDs get dark soon. */
START_CODE static void crystal_start(void)
{
    REGISTER(CLK_SYS_RESUS_CTRL) = 0;
    if (!(REGISTER(XOSC_STATUS) & 1u << 31)) {
        REGISTER(XOSC_CTRL) = 0xaa0;           /* 1 to 15 MHz */
        REGISTER(XOSC_STARTUP) = CRYSTAL_DELAY;
        SET_BITS(XOSC_CTRL) = 0xfabu << 12;    /* enable */
        wait_for(XOSC_STATUS, 1u << 31);
    }
    REGISTER(CLK_REF_CTRL) = 2;                /* crystal */
    wait_for(CLK_REF_SELECTED, 1u << 2);
}

START_CODE static void pll_start(uint32_t base, uint32_t reset, uint32_t feedback, uint32_t dividers)
{
    SET_BITS(RESETS_RESET) = reset;
    CLEAR_BITS(RESETS_RESET) = reset;
    wait_for(RESETS_DONE, reset);
    REGISTER(PLL_CS(base)) = 1;                /* reference divider */
    REGISTER(PLL_FBDIV(base)) = feedback;
    CLEAR_BITS(PLL_PWR(base)) = 1u << 0 | 1u << 5;
    wait_for(PLL_CS(base), 1u << 31);          /* locked */
    REGISTER(PLL_PRIM(base)) = dividers;
    CLEAR_BITS(PLL_PWR(base)) = 1u << 3;
}

/* Before anything is in RAM. */
START_CODE void clock_raise(void)
{
    crystal_start();
    pll_start(PLL_SYS_BASE, RESET_PLL_SYS, 120, 6u << 16 | 2u << 12);
    pll_start(PLL_USB_BASE, RESET_PLL_USB, 100, 5u << 16 | 5u << 12);
    REGISTER(CLK_SYS_CTRL) = 0;                /* auxiliary source: PLL_SYS */
    SET_BITS(CLK_SYS_CTRL) = 1;
    wait_for(CLK_SYS_SELECTED, 1u << 1);
}

static void free_blocks(uint32_t resets)
{
    CLEAR_BITS(RESETS_RESET) = resets;
    while ((REGISTER(RESETS_DONE) & resets) != resets)
        ;
}

static void prioritize(uint32_t irq, uint32_t priority)
{
    uint32_t shift = 8u * (irq % 4u);
    REGISTER(NVIC_IPR(irq / 4u)) = (REGISTER(NVIC_IPR(irq / 4u)) & ~(0xffu << shift)) | priority << shift;
}

void clock_start(void)
{
    REGISTER(CLK_PERI_CTRL) = 1u << 11;
    REGISTER(CLK_USB_CTRL) = 1u << 11;
    REGISTER(CLK_ADC_CTRL) = 1u << 11;
    free_blocks(RESET_ADC | RESET_DMA | RESET_IO_BANK0 | RESET_PADS_BANK0 | RESET_PIO0 | RESET_TIMER | RESET_USBCTRL);
    SET_BITS(TIMER_INTE) = 1u << 0 | 1u << 1 | 1u << 2 | 1u << 3;
    REGISTER(TIMER_ALARM(1)) = REGISTER(TIMER_TIMERAWL) + TICK_US;
    prioritize(IRQ_TIMER_0, 0x00u);        /* the light before all else */
    prioritize(IRQ_TIMER_2, 0x40u);        /* the trigger output, and the trigger */
    prioritize(IRQ_IO_BANK0, 0x40u);
    prioritize(IRQ_TIMER_1, 0xc0u);
    prioritize(IRQ_TIMER_3, 0xc0u);
    prioritize(IRQ_USB, 0xc0u);
    REGISTER(NVIC_ISER) = 1u << IRQ_TIMER_0 | 1u << IRQ_TIMER_1 | 1u << IRQ_TIMER_2 | 1u << IRQ_TIMER_3;
}

uint64_t clock_micros(void)
{
    uint32_t high, low;
    do {
        high = REGISTER(TIMER_TIMERAWH);
        low = REGISTER(TIMER_TIMERAWL);
    } while (high != REGISTER(TIMER_TIMERAWH));
    return (uint64_t)high << 32 | low;
}

void tick_interrupt(void)
{
    REGISTER(TIMER_INTR) = 1u << 1;
    REGISTER(TIMER_ALARM(1)) = REGISTER(TIMER_TIMERAWL) + TICK_US;
    passed = true;
}

bool tick_passed(void)
{
    bool before = passed;
    passed = false;
    return before;
}
