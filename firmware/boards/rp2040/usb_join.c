/*
 * Erratum RP2040-E5, of the silicon B0 and B1: after a bus reset the controller joins the bus once that has been idle for
 * 800 us, which it never is on a hub that passes on packets for other devices. As published, the idle state J is forced for
 * a millisecond once the reset is over: the data lines come from the pads instead of the PHY, where GPIO15 stands for D+ and
 * reads high by an override, and D- reads low because GPIO16 is not given to USB. The pull-up has to stay meanwhile.
 * Where GPIO15 is given to something else nothing is forced.
 */
#include "usb_wire.h"

#define B0_OR_B1 1u
#define DATA_PLUS 15u
#define CONNECTED (1u << 16)
#define LINE_STATE (3u << 2) /* 0: the host resets */
#define PULL_UP (1u << 1)
#define PULL_UP_OVERRIDE (1u << 2)
#define LOOK_US 1000u
#define MOST_RESET_LOOKS 200u
#define MOST_FORCED_LOOKS 10u /* one will do; the host asks nothing for ten */

static enum { JOIN_DONE, JOIN_RESET, JOIN_FORCED } state;
static uint32_t function, pad, looks;

static void force_idle(void)
{
    function = REGISTER(IO_BANK0_CTRL(DATA_PLUS));
    pad = REGISTER(PADS_BANK0(DATA_PLUS));
    REGISTER(PADS_BANK0(DATA_PLUS)) = pad | PAD_BUS_KEEP;
    REGISTER(IO_BANK0_CTRL(DATA_PLUS)) = FUNCTION_USB | PIN_OUTPUT_OFF | PIN_INPUT_HIGH;
    SET_BITS(USB_PHY_DIRECT) = PULL_UP;
    SET_BITS(USB_PHY_OVERRIDE) = PULL_UP_OVERRIDE;
    REGISTER(USB_MUXING) = TO_PADS;
}

static void release(void)
{
    REGISTER(USB_MUXING) = TO_PHY;
    CLEAR_BITS(USB_PHY_OVERRIDE) = PULL_UP_OVERRIDE;
    REGISTER(IO_BANK0_CTRL(DATA_PLUS)) = function;
    REGISTER(PADS_BANK0(DATA_PLUS)) = pad;
    state = JOIN_DONE;
}

static void look_later(void)
{
    REGISTER(TIMER_ALARM(3)) = REGISTER(TIMER_TIMERAWL) + LOOK_US;
}

void join_abandon(void)
{
    REGISTER(TIMER_ARMED) = 1u << 3;
    REGISTER(TIMER_INTR) = 1u << 3;
    REGISTER(NVIC_ICPR) = 1u << IRQ_TIMER_3;
    if (state == JOIN_FORCED)
        release();
    state = JOIN_DONE;
}

void join_begin(void)
{
    join_abandon();
    if (REGISTER(SYSINFO_CHIP_ID) >> 28 != B0_OR_B1 || (REGISTER(IO_BANK0_CTRL(DATA_PLUS)) & FUNCTION_NONE) != FUNCTION_NONE)
        return;
    state = JOIN_RESET;
    looks = 0;
    look_later();
}

void join_interrupt(void)
{
    uint32_t bus = REGISTER(USB_SIE_STATUS);
    REGISTER(TIMER_INTR) = 1u << 3;
    if (++looks > MOST_RESET_LOOKS || (state == JOIN_FORCED && bus & CONNECTED)) {
        join_abandon();
        return;
    }
    if (state == JOIN_RESET && bus & LINE_STATE) {
        force_idle();
        state = JOIN_FORCED;
        looks = MOST_RESET_LOOKS - MOST_FORCED_LOOKS;
    }
    look_later();
}
