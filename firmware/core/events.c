#include "events.h"

#include "bytes.h"

static void send_event(struct controller *controller, enum event type, const void *record, uint8_t count)
{
    struct packet packet = {.type = (uint8_t)type, .sequence = controller->event_sequence++, .count = count};
    uint8_t wire[PACKET_WIRE_BYTES];
    if (!controller->open)
        return;
    bytes_copy(packet.payload, record, count);
    size_t size = packet_encode(&packet, wire);
    if (!controller->port->send(controller->port->context, wire, size, PACKET_WIRE_BYTES)) /* room for a reply is kept */
        controller->counters.events_dropped++;
}

void event_light(struct controller *controller, const struct latched *latched)
{
    struct light_event event = {
        .first_bit_us = latched->first_bit_us,
        .latched_us = latched->latched_us,
        .light_id = controller->shown_id,
        .repetition = controller->shown.repetition,
        .loop = controller->shown.loop,
        .events_dropped = (uint16_t)controller->counters.events_dropped,
        .step = controller->shown.step,
        .group = controller->shown.group,
    };
    send_event(controller, EVENT_LIGHT, &event, sizeof event);
}

void event_dark(struct controller *controller)
{
    struct dark_event event = {
        .time_us = controller_now_us(controller),
        .events_dropped = (uint16_t)controller->counters.events_dropped,
        .dark = controller->dark,
    };
    send_event(controller, EVENT_DARK, &event, sizeof event);
}

void event_dimmed(struct controller *controller)
{
    struct dimmed_event event = {
        .time_us = controller_now_us(controller),
        .temperature = heat_temperature(&controller->heat),
        .events_dropped = (uint16_t)controller->counters.events_dropped,
        .dimmed = controller->heat.dimmed,
        .mean_ma = heat_mean_ma(&controller->heat),
        .ring_temperature = heat_ring_temperature(&controller->heat),
    };
    send_event(controller, EVENT_DIMMED, &event, sizeof event);
}

void status_now(const struct controller *controller, struct status_reply *status)
{
    const struct port *port = controller->port;
    *status = (struct status_reply){
        .time_us = port->micros(port->context),
        .light_id = controller->shown_id,
        .config_saves = controller->config.saves,
        .current_ma = controller->shown_ma,
        .limit_ma = controller->limits.limit_ma,
        .temperature = port->temperature(port->context),
        .repetition = controller->shown.repetition,
        .loop = controller->shown.loop,
        .events_dropped = (uint16_t)controller->counters.events_dropped,
        .state = controller->sequencer.running ? STATE_RUNNING : STATE_STILL,
        .dark = controller->dark,
        .mode = controller->sequencer.mode,
        .step = controller->shown.step,
        .dimmed = controller->heat.dimmed,
        .mean_ma = heat_mean_ma(&controller->heat),
        .ring_temperature = heat_ring_temperature(&controller->heat),
    };
}
