/* What the board tells by itself: each light that was latched, darkness that nobody asked for, its status. */
#ifndef GELLIGHT_EVENTS_H
#define GELLIGHT_EVENTS_H

#include "state.h"

/* When the transfer of a light began, and when the LEDs took it. */
struct latched {
    uint64_t first_bit_us, latched_us;
};

/* The record of STATUS. */
void status_now(const struct controller *controller, struct status_reply *status);

void event_light(struct controller *controller, const struct latched *latched);
void event_dark(struct controller *controller);
void event_dimmed(struct controller *controller);

#endif
