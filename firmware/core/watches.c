#include "watches.h"

#include "events.h"
#include "lights.h"
#include "thermistor.h"

#define RESTART_DELAY_US 20000u /* for the reply and the darkness to get out */

static void watch_host(struct controller *controller)
{
    uint64_t silent_us = controller_now_us(controller) - controller->packet_us;
    if (!lights_will_shine(controller) || controller->silent || silent_us <= controller->config.current.host_timeout_ms * 1000u)
        return;
    controller->silent = true;
    lights_darken(controller, DARK_HOST_SILENT);
}

/* Without a trigger the ring is dark, but the sequence goes on: the next edge lights its step. */
static void watch_trigger(struct controller *controller)
{
    static const uint8_t black[COLOUR_BYTES];
    struct trigger *trigger = &controller->trigger;
    if (!controller->sync.timeout_us || !trigger->armed || !controller->shown_shines)
        return;
    uint32_t last_us = trigger->last_us; /* before the clock: an edge between the two would be later than now */
    if ((uint32_t)controller_now_us(controller) - last_us <= controller->sync.timeout_us || !trigger_disarm(trigger))
        return;
    lights_withdraw(controller);
    controller->counters.trigger_timeouts++;
    lights_show(controller, black);
    controller->dark = DARK_TRIGGER_MISSED;
    event_dark(controller);
}

/* What is lit until something else is asked for is shown anew; what a sequence times is dimmed from its next light on. */
static void show_again(struct controller *controller)
{
    struct trigger *trigger = &controller->trigger;
    bool timed = controller->sequencer.running && controller->sequencer.mode == SYNC_MODE_FREE;
    if (controller->shown_dimmed == controller->heat.dimmed || !controller->shown_shines || controller->still_wanted || timed)
        return;
    if (controller->slot.busy && (!trigger->armed || !trigger_disarm(trigger)))
        return;
    lights_withdraw(controller);
    lights_show_again(controller);
}

static void watch_heat(struct controller *controller)
{
    const struct port *port = controller->port;
    uint64_t now_us = controller_now_us(controller);
    if (heat_due(&controller->heat, now_us)) {
        int16_t ring = thermistor_temperature(port->thermistor(port->context));
        if (heat_read(&controller->heat, now_us, port->temperature(port->context), ring, controller->limits.hottest_c))
            event_dimmed(controller);
    }
    show_again(controller);
}

void watches_restart(struct controller *controller, bool bootloader)
{
    lights_go_dark(controller, DARK_COMMAND);
    controller->restart_us = controller_now_us(controller);
    controller->restart_bootloader = bootloader;
}

static void watch_restart(struct controller *controller)
{
    const struct port *port = controller->port;
    if (controller->restart_us && controller_now_us(controller) - controller->restart_us > RESTART_DELAY_US)
        port->restart(port->context, controller->restart_bootloader);
}

void watches_look(struct controller *controller)
{
    watch_host(controller);
    watch_trigger(controller);
    watch_heat(controller);
    watch_restart(controller);
}
