#include "controller.h"

#include "bytes.h"
#include "commands.h"
#include "events.h"
#include "lights.h"
#include "watches.h"

#define OVERDUE_US 20000u /* a light that is later will never come: its transfer broke off */

void controller_start(struct controller *controller, const struct port *port)
{
    bytes_fill(controller, 0, sizeof *controller);
    controller->port = port;
    controller->sync.divider = 1;
    controller->trigger.divider = 1;
    controller->shown = (struct sequencer_position){.step = NO_STEP, .group = NO_STEP};
    config_load(&controller->config, port);
    controller->saves_us = controller_now_us(controller) + port->identity.saves * SAVE_EVERY_US;
    controller->limits.led_count = controller->config.current.led_count;
    controller->colour_order = controller->config.current.colour_order;
    controller->supply.fitted = controller->config.current.switch_pin != NO_PIN;
    controller->pulse_middle = controller->config.current.output_at == OUTPUT_AT_MIDDLE;
    port->setup(port->context, &controller->config.current);
    ring_configure(&controller->limits, &controller->config.current);
    controller->granted = controller->limits;
    lights_go_dark(controller, DARK_BOOT);
    controller_poll(controller);
}

/* The next light is planned before the last one is reported: its time may be near, the report can wait. */
void controller_poll(struct controller *controller)
{
    struct latched latched;
    bool finished = lights_finish(controller, &latched);
    watches_look(controller);
    lights_plan(controller);
    if (finished)
        event_light(controller, &latched);
    if (!controller->slot.busy && !lights_will_shine(controller))
        supply_open(&controller->supply, controller->port);
}

void controller_link(struct controller *controller, bool open, enum dark reason)
{
    packet_reset(&controller->receiver);
    controller->request_kept = false;
    controller->open = open;
    controller->packet_us = controller_now_us(controller);
    if (!open) {
        if (lights_will_shine(controller))
            controller->counters.dark_faults++;
        lights_go_dark(controller, reason);
    }
}

static bool repeats(const struct controller *controller, const struct packet *request)
{
    const struct packet *kept = &controller->request;
    return controller->request_kept && request->type != COMMAND_HELLO && request->type == kept->type &&
           request->sequence == kept->sequence && request->count == kept->count &&
           bytes_equal(request->payload, kept->payload, kept->count);
}

static void answer(struct controller *controller, const struct packet *request)
{
    const struct port *port = controller->port;
    struct packet reply;
    controller->packet_us = controller_now_us(controller);
    controller->silent = false;
    controller->counters.packets++;
    if (repeats(controller, request)) {
        controller->counters.repeated++;
    } else {
        commands_execute(controller, request, &reply);
        controller->reply_count = packet_encode(&reply, controller->reply);
        controller->request = *request;
        controller->request_kept = true;
    }
    if (!port->send(port->context, controller->reply, controller->reply_count, 0))
        controller->counters.replies_dropped++;
}

void controller_receive(struct controller *controller, uint8_t byte)
{
    struct packet request;
    if (!controller->open) /* bytes that were under way when the port closed must light nothing any more */
        return;
    switch (packet_receive(&controller->receiver, byte, &request)) {
    case PACKET_NONE:
        break;
    case PACKET_COMPLETE:
        answer(controller, &request);
        break;
    case PACKET_BAD_FRAMING:
        controller->counters.bad_framing++;
        break;
    case PACKET_BAD_CRC:
        controller->counters.bad_crc++;
        break;
    case PACKET_OVERSIZE:
        controller->counters.oversize++;
        break;
    }
}

bool controller_healthy(const struct controller *controller)
{
    const struct controller_slot *slot = &controller->slot;
    const struct trigger *trigger = &controller->trigger;
    uint64_t start_us = slot->start_us;
    if (slot->busy && start_us == PORT_ON_TRIGGER && trigger->released)
        start_us = trigger->start_us;
    return !slot->busy || start_us == PORT_ON_TRIGGER || controller_now_us(controller) < start_us + OVERDUE_US;
}
