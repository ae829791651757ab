/* The road of a light to the LEDs: one at a time is wanted, planned, handed to the board and latched. */
#ifndef GELLIGHT_LIGHTS_H
#define GELLIGHT_LIGHTS_H

#include "events.h"
#include "state.h"

/* Hand over what comes next, unless a light is still on its way. */
void lights_plan(struct controller *controller);

/* Take note of a light that was latched; false if none was. */
bool lights_finish(struct controller *controller, struct latched *latched);

/* Colours to show until something else is asked for. */
void lights_show(struct controller *controller, const uint8_t colours[COLOUR_BYTES]);
void lights_show_again(struct controller *controller); /* as it is dimmed now: the same step, without another pulse */
void lights_go_dark(struct controller *controller, enum dark reason);
void lights_darken(struct controller *controller, enum dark reason); /* by a fault: counted and told */
void lights_end_sequence(struct controller *controller);
void lights_withdraw(struct controller *controller); /* the light that waits, unless it has begun */

/* Whether the LEDs will be lit when all that is under way has been latched. */
bool lights_will_shine(const struct controller *controller);

#endif
