/*
 * Clocks: crystal 12 MHz -> PLL_USB 480 MHz / 5 / 2 = 48 MHz for the processor, USB and the ADC. One PLL, and the
 * PIO reaches the 12 MHz of the WS2812B waveform by the whole divider 4, so without jitter.
 */
#include "board.h"
#include "registers.h"

#define TICK_US 10000u

static volatile bool passed;

START_CODE static void wait_for(uint32_t address, uint32_t bits)
{
    while ((REGISTER(address) & bits) != bits)
        ;
}

START_CODE static void crystal_start(void)
{
    REGISTER(CLK_SYS_RESUS_CTRL) = 0;
    REGISTER(XOSC_CTRL) = 0xaa0;           /* 1 to 15 MHz */
    REGISTER(XOSC_STARTUP) = 47;           /* 1 ms: 12 MHz / 256 / 1000 */
    SET_BITS(XOSC_CTRL) = 0xfabu << 12;    /* enable */
    wait_for(XOSC_STATUS, 1u << 31);
    REGISTER(CLK_REF_CTRL) = 2;            /* crystal */
    wait_for(CLK_REF_SELECTED, 1u << 2);
}

START_CODE static void pll_start(void)
{
    CLEAR_BITS(RESETS_RESET) = RESET_PLL_USB;
    wait_for(RESETS_DONE, RESET_PLL_USB);
    REGISTER(PLL_USB_CS) = 1;              /* reference divider */
    REGISTER(PLL_USB_FBDIV) = 40;          /* 12 MHz * 40 = 480 MHz */
    CLEAR_BITS(PLL_USB_PWR) = 1u << 0 | 1u << 5;
    wait_for(PLL_USB_CS, 1u << 31);        /* locked */
    REGISTER(PLL_USB_PRIM) = 5u << 16 | 2u << 12;
    CLEAR_BITS(PLL_USB_PWR) = 1u << 3;
}

/* Before anything is in RAM. */
START_CODE void clock_raise(void)
{
    crystal_start();
    pll_start();
    REGISTER(CLK_SYS_CTRL) = 1u << 5;      /* auxiliary source: PLL_USB */
    SET_BITS(CLK_SYS_CTRL) = 1;
    wait_for(CLK_SYS_SELECTED, 1u << 1);
}

static void free_blocks(uint32_t resets)
{
    CLEAR_BITS(RESETS_RESET) = resets;
    while ((REGISTER(RESETS_DONE) & resets) != resets)
        ;
}

void clock_start(void)
{
    REGISTER(CLK_PERI_CTRL) = 1u << 11;
    REGISTER(CLK_USB_CTRL) = 1u << 11;
    REGISTER(CLK_ADC_CTRL) = 1u << 11;
    REGISTER(WATCHDOG_TICK) = 1u << 9 | 12; /* 1 us, for the timer too */
    free_blocks(RESET_ADC | RESET_DMA | RESET_IO_BANK0 | RESET_PADS_BANK0 | RESET_PIO0 | RESET_TIMER | RESET_USBCTRL);
    REGISTER(ADC_CS) = 4u << 12 | 1u << 1 | 1u << 0; /* temperature sensor */
    SET_BITS(TIMER_INTE) = 1u << 0 | 1u << 1;
    REGISTER(TIMER_ALARM(1)) = REGISTER(TIMER_TIMERAWL) + TICK_US;
    REGISTER(NVIC_IPR(0)) = 0xc0c0c000u;   /* the light before all else */
    REGISTER(NVIC_IPR(1)) = 0xc0c0c0c0u;
    REGISTER(NVIC_IPR(3)) = 0xc0c040c0u;   /* then the trigger (13) */
    REGISTER(NVIC_ISER) = 1u << IRQ_TIMER_0 | 1u << IRQ_TIMER_1;
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

uint16_t clock_temperature(void)
{
    SET_BITS(ADC_CS) = 1u << 2; /* one conversion, 2 us */
    while (!(REGISTER(ADC_CS) & 1u << 8))
        ;
    return (uint16_t)REGISTER(ADC_RESULT);
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
