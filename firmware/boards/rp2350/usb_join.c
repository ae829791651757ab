/* The RP2350 joins a busy bus by itself: nothing of erratum RP2040-E5 is left to do. */
#include "usb_wire.h"

void join_begin(void)
{
}

void join_abandon(void)
{
}

void join_interrupt(void)
{
    REGISTER(TIMER_INTR) = 1u << 3;
}
