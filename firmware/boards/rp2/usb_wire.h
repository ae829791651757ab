/* What the two halves of the USB device share: the buffers of the controller, and what each half asks of the other. */
#ifndef GELLIGHT_RP2_USB_WIRE_H
#define GELLIGHT_RP2_USB_WIRE_H

#include "board.h"
#include "registers.h"

/* Buffer control words (data sheet 4.1.2.5). */
#define FULL (1u << 15)
#define LAST (1u << 14)
#define DATA1 (1u << 13)
#define STALL (1u << 11)
#define AVAILABLE (1u << 10)
#define COUNT 0x3ffu
#define PACKET 64u
#define BUFFER_CONTROL(endpoint, out) (USB_DPRAM + 0x80u + 8u * (endpoint) + ((out) ? 4u : 0u))

#define NOTIFY_IN 0x81u
#define BULK_OUT 0x02u
#define BULK_IN 0x82u

/* USB_MUXING: where the data lines come from; with software connect */
#define TO_PHY (1u << 0 | 1u << 3)
#define TO_PADS (1u << 2 | 1u << 3)

static inline volatile uint8_t *dpram(uint32_t address)
{
    return (volatile uint8_t *)address;
}

/* AVAILABLE goes last, and later than the rest by a cycle of clk_usb at least, which is 2.5 of the processor (4.1.2.5.1). */
static inline void hand_over(uint32_t control, uint32_t value)
{
    REGISTER(control) = value;
    __asm volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop");
    REGISTER(control) = value | AVAILABLE;
}

/* usb_control.c, called by the interrupt */
void control_setup(void);
void control_sent(void);
void control_received(void);
void control_reset(void);

/* usb_join.c, called where the bus is reset, and before the controller is */
void join_begin(void);
void join_abandon(void);

/* usb.c, called by endpoint 0 */
void data_configure(bool configured);
void data_lines(bool ready, uint32_t baud);
void data_halt(uint32_t endpoint);
void data_clear_halt(uint32_t endpoint);
bool data_halted(uint32_t endpoint);
void usb_note(enum usb_event what);

#endif
