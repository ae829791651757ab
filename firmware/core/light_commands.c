/* The requests about light: still light, groups, steps and sequences. */
#include "commands.h"

#include "bytes.h"
#include "lights.h"

/* Refuse colours above the limit; current and scale are those of the light as it is dimmed now. */
static enum status limit(struct call *call, const uint8_t colours[COLOUR_BYTES], uint16_t *current_ma, uint16_t *scale)
{
    const struct ring_limits *limits = &call->controller->limits;
    uint8_t halvings = call->controller->heat.dimmed, dimmed[COLOUR_BYTES];
    if (!ring_within(limits, colours))
        return refuse(call, STATUS_OVER_CURRENT, ring_current_ma(limits, colours));
    bytes_copy(dimmed, colours, COLOUR_BYTES);
    ring_dim(halvings, dimmed);
    *current_ma = ring_current_ma(limits, dimmed);
    *scale = (uint16_t)(FULL_SCALE >> halvings);
    return STATUS_OK;
}

/* The host sends as many colours as there are LEDs, which has been checked; behind them it is dark. */
static void take_colours(const struct call *call, const uint8_t *sent, uint8_t colours[COLOUR_BYTES])
{
    uint32_t count = 3u * call->controller->limits.led_count;
    bytes_copy(colours, sent, count);
    bytes_fill(colours + count, 0, COLOUR_BYTES - count);
}

enum status handle_set_leds(struct call *call)
{
    struct controller *controller = call->controller;
    const struct set_leds *request = call->request;
    struct light_reply *reply = call->reply;
    uint8_t colours[COLOUR_BYTES];
    uint16_t current_ma = 0, scale = 0;
    if (running(call))
        return STATUS_BUSY;
    take_colours(call, request->colours, colours);
    enum status status = limit(call, colours, &current_ma, &scale);
    if (status != STATUS_OK)
        return status;
    lights_show(controller, colours);
    controller->dark = DARK_COMMAND;
    reply->light_id = controller->still_id;
    reply->current_ma = current_ma;
    reply->scale = scale;
    return STATUS_OK;
}

enum status handle_set_group(struct call *call)
{
    const struct set_group *request = call->request;
    struct group_reply *reply = call->reply;
    uint8_t colours[COLOUR_BYTES];
    uint16_t current_ma = 0, scale = 0;
    if (outside(call, request->group, 0, GROUP_COUNT - 1))
        return STATUS_OUT_OF_RANGE;
    take_colours(call, request->colours, colours);
    enum status status = limit(call, colours, &current_ma, &scale);
    if (status != STATUS_OK)
        return status;
    take_colours(call, request->colours, call->controller->sequencer.staged.groups[request->group]);
    reply->current_ma = current_ma;
    reply->scale = scale;
    return STATUS_OK;
}

static bool no_duration(struct call *call, uint32_t duration_us)
{
    return duration_us && outside(call, duration_us, DWELL_MIN_US, DWELL_MAX_US);
}

enum status handle_set_step(struct call *call)
{
    const struct set_step *request = call->request;
    if (outside(call, request->step, 0, STEP_COUNT - 1) || outside(call, request->group, 0, GROUP_COUNT - 1) ||
        outside(call, request->repeat, 1, UINT16_MAX) || no_duration(call, request->dwell_us) ||
        no_duration(call, request->blank_us))
        return STATUS_OUT_OF_RANGE;
    call->controller->sequencer.staged.steps[request->step] = *request;
    return STATUS_OK;
}

/* A table can run if all its steps are set, fit the mode, and light no group above the limit. */
static enum status playable(struct call *call, const struct sequencer_table *table, uint8_t step_count)
{
    const struct controller *controller = call->controller;
    const struct ring_limits *limits = &controller->limits;
    for (uint8_t i = 0; i < step_count; i++) {
        const struct set_step *step = &table->steps[i];
        const uint8_t *colours = table->groups[step->group];
        if (!step->repeat || (controller->sync.mode == SYNC_MODE_FREE && !step->dwell_us))
            return refuse(call, STATUS_OUT_OF_RANGE, i);
        if (!ring_within(limits, colours))
            return refuse(call, STATUS_OVER_CURRENT, ring_current_ma(limits, colours));
    }
    return STATUS_OK;
}

enum status handle_commit(struct call *call)
{
    struct sequencer *sequencer = &call->controller->sequencer;
    const struct commit *request = call->request;
    if (outside(call, request->step_count, 1, STEP_COUNT))
        return STATUS_OUT_OF_RANGE;
    uint32_t crc = sequencer_table_crc(&sequencer->staged, request->step_count, call->controller->limits.led_count);
    if (crc != request->table_crc)
        return refuse(call, STATUS_CHECKSUM, crc);
    enum status status = playable(call, &sequencer->staged, request->step_count);
    if (status == STATUS_OK)
        sequencer_commit(sequencer, request->step_count, request->loops);
    return status;
}

enum status handle_set_sync(struct call *call)
{
    struct controller *controller = call->controller;
    const struct set_sync *request = call->request;
    if (running(call))
        return STATUS_BUSY;
    if (outside(call, request->mode, 0, SYNC_MODE_EXT) || outside(call, request->edge, 0, EDGE_FALLING) ||
        outside(call, request->divider, 1, UINT16_MAX) || outside(call, request->delay_us, 0, DWELL_MAX_US) ||
        outside(call, request->timeout_us, 0, DWELL_MAX_US))
        return STATUS_OUT_OF_RANGE;
    if (request->mode == SYNC_MODE_EXT && !(controller->port->identity.capabilities & CAPABILITY_TRIGGER))
        return STATUS_WRONG_MODE;
    controller->sync = *request;
    controller->sequencer.mode = request->mode;
    controller->trigger.delay_us = request->delay_us;
    controller->trigger.divider = request->divider;
    return STATUS_OK;
}

enum status handle_trim(struct call *call)
{
    struct sequencer *sequencer = &call->controller->sequencer;
    const struct trim *request = call->request;
    if (!running(call))
        return STATUS_NOT_RUNNING;
    if (sequencer->mode != SYNC_MODE_FREE)
        return STATUS_WRONG_MODE;
    uint32_t phase_us = (uint32_t)sequencer->trim.phase_us + (uint32_t)request->phase_us; /* with what still waits */
    if (outside(call, (uint32_t)request->period + TRIM_MAX, 0, 2 * TRIM_MAX) ||
        outside(call, phase_us + DWELL_MAX_US, 0, 2 * DWELL_MAX_US))
        return STATUS_OUT_OF_RANGE;
    sequencer->trim = (struct trim){.phase_us = (int32_t)phase_us, .period = request->period};
    return STATUS_OK;
}

enum status handle_start(struct call *call)
{
    struct controller *controller = call->controller;
    const struct port *port = controller->port;
    struct sequencer *sequencer = &controller->sequencer;
    if (running(call))
        return STATUS_BUSY;
    if (!sequencer->active.step_count)
        return STATUS_NOT_RUNNING;
    enum status status = playable(call, &sequencer->active, sequencer->active.step_count);
    if (status != STATUS_OK)
        return status;
    uint64_t now_us = port->micros(port->context);
    supply_close(&controller->supply, port);
    uint64_t ready_us = controller->supply.settled_us > now_us ? controller->supply.settled_us : now_us;
    sequencer_start(sequencer, ready_us + DWELL_MIN_US);
    trigger_restart(&controller->trigger, now_us);
    port->trigger(port->context, sequencer->mode == SYNC_MODE_EXT, controller->sync.edge == EDGE_FALLING);
    return STATUS_OK;
}

enum status handle_stop(struct call *call)
{
    if (!running(call))
        return STATUS_NOT_RUNNING;
    lights_end_sequence(call->controller);
    return STATUS_OK;
}

enum status handle_blank(struct call *call)
{
    lights_go_dark(call->controller, DARK_COMMAND);
    return STATUS_OK;
}
