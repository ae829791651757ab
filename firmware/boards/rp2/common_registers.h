/* What the chips of this family have alike: accesses, USB, PIO, the interrupt controller, the interrupts of the timer. */
#ifndef GELLIGHT_COMMON_REGISTERS_H
#define GELLIGHT_COMMON_REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
/* Every peripheral register has aliases that set or clear single bits in one access (RP2040 2.1.2, RP2350 2.1.3). */
#define SET_BITS(address) REGISTER((address) + 0x2000u)
#define CLEAR_BITS(address) REGISTER((address) + 0x3000u)

/* What a pin is: its pad, and the function it is given to (RP2040 2.19.2, RP2350 9.6). */
#define PAD_OUTPUT 0x52u    /* 4 mA, Schmitt trigger, no pull; on the RP2350 it is not isolated then */
#define PAD_PULLED_UP 0x4au /* input, Schmitt trigger */
#define PAD_ANALOG 0x80u    /* neither output nor input: for the converter */
#define PAD_ANALOG_PULLED_UP 0x88u
#define FUNCTION_SIO 5u
#define FUNCTION_PIO0 6u
#define FUNCTION_NONE 31u /* and all bits of FUNCSEL */

#define PLL_CS(base) (base)
#define PLL_PWR(base) ((base) + 0x4u)
#define PLL_FBDIV(base) ((base) + 0x8u)
#define PLL_PRIM(base) ((base) + 0xcu)

#define USB_DPRAM 0x50100000u
#define USB_BASE 0x50110000u
#define USB_ADDR_ENDP (USB_BASE + 0x00u)
#define USB_MAIN_CTRL (USB_BASE + 0x40u)
#define USB_SOF_RD (USB_BASE + 0x48u)
#define USB_SIE_CTRL (USB_BASE + 0x4cu)
#define USB_SIE_STATUS (USB_BASE + 0x50u)
#define USB_BUFF_STATUS (USB_BASE + 0x58u)
#define USB_EP_STALL_ARM (USB_BASE + 0x68u)
#define USB_MUXING (USB_BASE + 0x74u)
#define USB_PWR (USB_BASE + 0x78u)
#define USB_PHY_DIRECT (USB_BASE + 0x7cu)
#define USB_PHY_OVERRIDE (USB_BASE + 0x80u)
#define USB_INTE (USB_BASE + 0x90u)
#define USB_INTS (USB_BASE + 0x98u)

#define PIO0_CTRL 0x50200000u
#define PIO0_FSTAT 0x50200004u
#define PIO0_TXF0 0x50200010u
#define PIO0_INSTR_MEM(n) (0x50200048u + 4u * (n))
#define PIO0_SM0_CLKDIV 0x502000c8u
#define PIO0_SM0_EXECCTRL 0x502000ccu
#define PIO0_SM0_SHIFTCTRL 0x502000d0u
#define PIO0_SM0_INSTR 0x502000d8u
#define PIO0_SM0_PINCTRL 0x502000dcu

#define NVIC_ISER 0xe000e100u
#define NVIC_ICER 0xe000e180u
#define NVIC_ICPR 0xe000e280u
#define NVIC_IPR(n) (0xe000e400u + 4u * (n))
#define SCB_VTOR 0xe000ed08u

/* The interrupts, by their numbers. */
#define IRQ_TIMER_0 0u
#define IRQ_TIMER_1 1u
#define IRQ_TIMER_2 2u
#define IRQ_TIMER_3 3u

/* Interrupts off, returning what they were; for the few instructions that must not be split. */
static inline uint32_t interrupts_off(void)
{
    uint32_t before;
    __asm volatile("mrs %0, primask\n cpsid i" : "=r"(before)::"memory");
    return before;
}

static inline void interrupts_restore(uint32_t before)
{
    __asm volatile("msr primask, %0" ::"r"(before) : "memory");
}

#endif
