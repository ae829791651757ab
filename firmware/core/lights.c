#include "lights.h"

#include "bytes.h"

static void hand_over(struct controller *controller)
{
    const struct port *port = controller->port;
    struct controller_slot *slot = &controller->slot;
    uint64_t now_us = controller_now_us(controller);
    if (slot->shines)
        supply_close(&controller->supply, port);
    if (slot->start_us < controller->supply.settled_us)
        slot->start_us = controller->supply.settled_us;
    if (slot->start_us < now_us) /* late: it goes out now, and is overdue from now on, not from when it should have */
        slot->start_us = now_us;
    port->pulse(port->context, slot->pulse_us);
    port->light(port->context, slot->wire, slot->start_us, controller->config.current.latch_us);
}

/* The last gate before the LEDs: whatever came before, nothing above the limit passes. */
static bool load(struct controller *controller, const uint8_t colours[COLOUR_BYTES])
{
    struct controller_slot *slot = &controller->slot;
    uint8_t dimmed[COLOUR_BYTES];
    if (!ring_within(&controller->limits, colours))
        return false;
    bytes_copy(slot->colours, colours, COLOUR_BYTES);
    bytes_copy(dimmed, colours, COLOUR_BYTES);
    slot->dimmed = controller->heat.dimmed;
    ring_dim(slot->dimmed, dimmed);
    ring_wire_order(controller->colour_order, dimmed, slot->wire);
    uint32_t current_ua = ring_current_ua(&controller->limits, dimmed);
    slot->current_ma = ring_ma(current_ua);
    slot->shines = current_ua > (uint32_t)controller->limits.led_count * controller->limits.quiescent_ua;
    slot->pulse_us = slot->shines ? 0 : PORT_NO_PULSE;
    slot->busy = true;
    return true;
}

void lights_withdraw(struct controller *controller)
{
    const struct port *port = controller->port;
    controller->trigger.armed = false;
    if (controller->slot.busy && port->light_cancel(port->context))
        controller->slot.busy = false;
}

void lights_end_sequence(struct controller *controller)
{
    sequencer_stop(&controller->sequencer);
    controller->port->trigger(controller->port->context, false, false);
    lights_withdraw(controller);
    controller->slot.role = SEQUENCER_NONE; /* a transfer that goes on is no part of the next sequence */
}

void lights_show(struct controller *controller, const uint8_t colours[COLOUR_BYTES])
{
    bytes_copy(controller->still, colours, COLOUR_BYTES);
    controller->still_wanted = true;
    controller->still_again = false;
    controller->still_id = ++controller->next_id;
}

void lights_show_again(struct controller *controller)
{
    lights_show(controller, controller->shown_colours);
    controller->still_again = true;
}

void lights_go_dark(struct controller *controller, enum dark reason)
{
    static const uint8_t black[COLOUR_BYTES];
    lights_end_sequence(controller);
    lights_show(controller, black);
    controller->dark = (uint8_t)reason;
}

void lights_darken(struct controller *controller, enum dark reason)
{
    lights_go_dark(controller, reason);
    controller->counters.dark_faults++;
    event_dark(controller);
}

bool lights_will_shine(const struct controller *controller)
{
    static const uint8_t black[COLOUR_BYTES];
    if (controller->sequencer.running)
        return true;
    if (controller->still_wanted)
        return !bytes_equal(controller->still, black, COLOUR_BYTES);
    return controller->slot.busy ? controller->slot.shines : controller->shown_shines;
}

static void tell_sequencer(struct controller *controller, uint64_t first_bit_us)
{
    const struct port *port = controller->port;
    if (controller->slot.role == SEQUENCER_LIT)
        sequencer_began(&controller->sequencer, first_bit_us);
    if (controller->slot.role != SEQUENCER_END)
        return;
    controller->dark = DARK_SEQUENCE_ENDED;
    sequencer_stop(&controller->sequencer);
    port->trigger(port->context, false, false);
}

bool lights_finish(struct controller *controller, struct latched *latched)
{
    const struct port *port = controller->port;
    struct controller_slot *slot = &controller->slot;
    enum port_light result = PORT_LIGHT_NONE;
    if (slot->busy)
        result = port->light_result(port->context, &latched->first_bit_us, &latched->latched_us);
    if (result != PORT_LIGHT_LATCHED)
        return false;
    slot->busy = false;
    controller->counters.lights++;
    controller->shown = slot->at;
    controller->shown_id = slot->light_id;
    controller->shown_ma = slot->current_ma;
    heat_draw(&controller->heat, latched->latched_us, slot->current_ma);
    bytes_copy(controller->shown_colours, slot->colours, COLOUR_BYTES);
    controller->shown_dimmed = slot->dimmed;
    controller->shown_shines = slot->shines;
    if (slot->shines)
        controller->dark = DARK_NOT_DARK;
    tell_sequencer(controller, latched->first_bit_us);
    return true;
}

static void plan_still(struct controller *controller)
{
    struct controller_slot *slot = &controller->slot;
    controller->still_wanted = false;
    if (!load(controller, controller->still)) {
        lights_darken(controller, DARK_FAULT);
        return;
    }
    slot->at = (struct sequencer_position){.step = NO_STEP, .group = NO_STEP};
    if (controller->still_again) {
        slot->at = controller->shown;
        slot->pulse_us = PORT_NO_PULSE;
    }
    slot->light_id = controller->still_id;
    slot->start_us = 0;
    slot->role = SEQUENCER_NONE;
    hand_over(controller);
}

static void plan_sequence(struct controller *controller)
{
    static const uint8_t black[COLOUR_BYTES];
    struct sequencer *sequencer = &controller->sequencer;
    struct controller_slot *slot = &controller->slot;
    struct sequencer_plan plan;
    if (sequencer->mode == SYNC_MODE_EXT && controller_now_us(controller) < controller->supply.settled_us)
        return; /* the LEDs have no power yet: an edge is missed, as with any step that is not ready */
    enum sequencer_next next = sequencer_next(sequencer, &plan);
    if (!load(controller, next == SEQUENCER_LIT ? sequencer->active.groups[plan.at.group] : black)) {
        lights_darken(controller, DARK_FAULT);
        return;
    }
    slot->at = plan.at;
    slot->light_id = ++controller->next_id;
    slot->start_us = plan.start_us;
    slot->role = (uint8_t)next;
    if (slot->shines && controller->pulse_middle)
        slot->pulse_us = sequencer->active.steps[plan.at.step].dwell_us / 2u;
    if (plan.start_us && plan.start_us < controller_now_us(controller))
        controller->counters.late_steps++;
    hand_over(controller);
    if (plan.start_us == PORT_ON_TRIGGER)
        trigger_arm(&controller->trigger);
}

void lights_plan(struct controller *controller)
{
    if (controller->slot.busy)
        return;
    if (controller->still_wanted)
        plan_still(controller);
    else if (controller->sequencer.running)
        plan_sequence(controller);
}
