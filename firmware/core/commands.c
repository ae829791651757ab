/*
 * What each request does. A handler gets the request record, whose length has been checked, fills in the reply
 * record and returns a status; where it refuses, *value says what.
 */
#include "bytes.h"
#include "controller.h"
#include "version.h"

struct call {
    struct controller *controller;
    const void *request;
    void *reply;
    uint32_t value;
};

typedef enum status handler(struct call *call);

struct entry {
    uint8_t code;
    uint8_t request_bytes;
    uint8_t reply_bytes;
    handler *handle;
};

struct RECORD reply_head {
    uint8_t status;
    uint32_t value;
};

static enum status refuse(struct call *call, enum status status, uint32_t value)
{
    call->value = value;
    return status;
}

static bool outside(struct call *call, uint32_t value, uint32_t low, uint32_t high)
{
    call->value = value;
    return value < low || value > high;
}

static bool running(const struct call *call)
{
    return call->controller->sequencer.running;
}

static bool quiet(const struct controller *controller)
{
    return !controller->sequencer.running && !controller->shown_shines && !controller->slot.busy &&
           !controller->still_wanted;
}

static enum status handle_hello(struct call *call)
{
    const struct port_identity *identity = &call->controller->port->identity;
    struct hello_reply *reply = call->reply;
    reply->protocol_major = PROTOCOL_MAJOR;
    reply->protocol_minor = PROTOCOL_MINOR;
    reply->schema_crc = SCHEMA_CRC;
    reply->firmware_major = FIRMWARE_MAJOR;
    reply->firmware_minor = FIRMWARE_MINOR;
    reply->firmware_patch = FIRMWARE_PATCH;
    reply->board = identity->board;
    reply->reset_reason = identity->reset_reason;
    bytes_copy(reply->unique_id, identity->unique_id, sizeof reply->unique_id);
    reply->capabilities = identity->capabilities;
    reply->led_count = LED_COUNT;
    reply->group_count = GROUP_COUNT;
    reply->step_count = STEP_COUNT;
    reply->packet_bytes = PACKET_BYTES;
    reply->tick_hz = TICK_HZ;
    reply->image_crc = identity->image_crc;
    return STATUS_OK;
}

static enum status handle_clock(struct call *call)
{
    const struct controller *controller = call->controller;
    const struct port *port = controller->port;
    const struct clock_request *request = call->request;
    struct clock_reply *reply = call->reply;
    uint64_t sof_us;
    reply->host_us = request->host_us;
    reply->received_us = controller->packet_us;
    reply->sof_number = port->start_of_frame(port->context, &sof_us);
    reply->sof_us = sof_us;
    reply->sent_us = port->micros(port->context);
    return STATUS_OK;
}

static enum status limit(struct call *call, uint8_t colours[COLOUR_BYTES], uint16_t *current_ma, uint16_t *scale)
{
    const struct ring_limits *limits = &call->controller->limits;
    uint16_t asked_ma = ring_current_ma(limits, colours);
    if (!ring_limit(limits, colours, scale))
        return refuse(call, STATUS_OVER_CURRENT, asked_ma);
    *current_ma = ring_current_ma(limits, colours);
    return STATUS_OK;
}

static enum status handle_set_leds(struct call *call)
{
    struct controller *controller = call->controller;
    const struct set_leds *request = call->request;
    struct light_reply *reply = call->reply;
    uint8_t colours[COLOUR_BYTES];
    uint16_t current_ma = 0, scale = 0;
    if (running(call))
        return STATUS_BUSY;
    bytes_copy(colours, request->colours, COLOUR_BYTES);
    enum status status = limit(call, colours, &current_ma, &scale);
    if (status != STATUS_OK)
        return status;
    controller_show(controller, colours);
    controller->dark = DARK_COMMAND;
    reply->light_id = controller->still_id;
    reply->current_ma = current_ma;
    reply->scale = scale;
    return STATUS_OK;
}

static enum status handle_set_group(struct call *call)
{
    const struct set_group *request = call->request;
    struct group_reply *reply = call->reply;
    uint8_t colours[COLOUR_BYTES];
    uint16_t current_ma = 0, scale = 0;
    if (outside(call, request->group, 0, GROUP_COUNT - 1))
        return STATUS_OUT_OF_RANGE;
    bytes_copy(colours, request->colours, COLOUR_BYTES);
    enum status status = limit(call, colours, &current_ma, &scale);
    if (status != STATUS_OK)
        return status;
    bytes_copy(call->controller->sequencer.staged.groups[request->group], request->colours, COLOUR_BYTES);
    reply->current_ma = current_ma;
    reply->scale = scale;
    return STATUS_OK;
}

static bool no_duration(struct call *call, uint32_t duration_us)
{
    return duration_us && outside(call, duration_us, DWELL_MIN_US, DWELL_MAX_US);
}

static enum status handle_set_step(struct call *call)
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
    for (uint8_t i = 0; i < step_count; i++) {
        const struct set_step *step = &table->steps[i];
        uint8_t colours[COLOUR_BYTES];
        uint16_t current_ma, scale;
        if (!step->repeat || (controller->sync.mode == SYNC_MODE_FREE && !step->dwell_us))
            return refuse(call, STATUS_OUT_OF_RANGE, i);
        bytes_copy(colours, table->groups[step->group], COLOUR_BYTES);
        enum status status = limit(call, colours, &current_ma, &scale);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status handle_commit(struct call *call)
{
    struct sequencer *sequencer = &call->controller->sequencer;
    const struct commit *request = call->request;
    if (outside(call, request->step_count, 1, STEP_COUNT))
        return STATUS_OUT_OF_RANGE;
    uint32_t crc = sequencer_table_crc(&sequencer->staged, request->step_count);
    if (crc != request->table_crc)
        return refuse(call, STATUS_CHECKSUM, crc);
    enum status status = playable(call, &sequencer->staged, request->step_count);
    if (status == STATUS_OK)
        sequencer_commit(sequencer, request->step_count, request->loops);
    return status;
}

static enum status handle_set_sync(struct call *call)
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

static enum status handle_trim(struct call *call)
{
    struct sequencer *sequencer = &call->controller->sequencer;
    const struct trim *request = call->request;
    if (!running(call))
        return STATUS_NOT_RUNNING;
    if (sequencer->mode != SYNC_MODE_FREE)
        return STATUS_WRONG_MODE;
    if (outside(call, (uint32_t)request->period + TRIM_MAX, 0, 2 * TRIM_MAX) ||
        outside(call, (uint32_t)request->phase_us + DWELL_MAX_US, 0, 2 * DWELL_MAX_US))
        return STATUS_OUT_OF_RANGE;
    sequencer->trim = *request;
    return STATUS_OK;
}

static enum status handle_start(struct call *call)
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
    sequencer_start(sequencer, now_us + DWELL_MIN_US);
    trigger_restart(&controller->trigger, now_us);
    port->trigger(port->context, sequencer->mode == SYNC_MODE_EXT, controller->sync.edge == EDGE_FALLING);
    return STATUS_OK;
}

static enum status handle_step(struct call *call)
{
    struct controller *controller = call->controller;
    struct sequencer *sequencer = &controller->sequencer;
    struct light_reply *reply = call->reply;
    uint8_t colours[COLOUR_BYTES] = {0};
    uint16_t current_ma = 0, scale = FULL_SCALE;
    if (!running(call))
        return STATUS_NOT_RUNNING;
    if (sequencer->mode != SYNC_MODE_HOLD)
        return STATUS_WRONG_MODE;
    if (sequencer->stepped || controller->slot.busy)
        return STATUS_BUSY;
    if (!sequencer_over(sequencer))
        bytes_copy(colours, sequencer->active.groups[sequencer->active.steps[sequencer->next.step].group], COLOUR_BYTES);
    enum status status = limit(call, colours, &current_ma, &scale);
    if (status != STATUS_OK)
        return status;
    sequencer->stepped = true;
    controller->step_id = ++controller->next_id;
    reply->light_id = controller->step_id;
    reply->current_ma = current_ma;
    reply->scale = scale;
    return STATUS_OK;
}

static enum status handle_stop(struct call *call)
{
    if (!running(call))
        return STATUS_NOT_RUNNING;
    controller_end_sequence(call->controller);
    return STATUS_OK;
}

static enum status handle_blank(struct call *call)
{
    controller_go_dark(call->controller, DARK_COMMAND);
    return STATUS_OK;
}

static enum status handle_set_limits(struct call *call)
{
    struct controller *controller = call->controller;
    const struct set_limits *request = call->request;
    uint32_t cap_ma = controller->config.current.external_supply ? CURRENT_CAP_EXTERNAL_MA : CURRENT_CAP_MA;
    if (running(call))
        return STATUS_BUSY;
    if (outside(call, request->limit_ma, 100, cap_ma) || outside(call, request->policy, 0, POLICY_SCALE))
        return STATUS_OUT_OF_RANGE;
    controller->limits.limit_ma = request->limit_ma;
    controller->limits.policy = request->policy;
    if (controller->shown_ma > request->limit_ma)
        controller_go_dark(controller, DARK_COMMAND);
    return STATUS_OK;
}

void controller_status(const struct controller *controller, struct status_reply *status)
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
        .policy = controller->limits.policy,
        .mode = controller->sequencer.mode,
        .step = controller->shown.step,
    };
}

static enum status handle_status(struct call *call)
{
    controller_status(call->controller, call->reply);
    return STATUS_OK;
}

static enum status handle_counters(struct call *call)
{
    struct controller *controller = call->controller;
    controller->counters.triggers = controller->trigger.count;
    controller->counters.triggers_missed = controller->trigger.missed;
    controller->counters.flash_retries = controller->config.retries;
    bytes_copy(call->reply, &controller->counters, sizeof controller->counters);
    return STATUS_OK;
}

static enum status handle_telemetry(struct call *call)
{
    const struct telemetry *request = call->request;
    call->controller->telemetry_ms = request->period_ms;
    return STATUS_OK;
}

static enum status handle_get_config(struct call *call)
{
    bytes_copy(call->reply, &call->controller->config.current, sizeof(struct configuration));
    return STATUS_OK;
}

static enum status handle_set_config(struct call *call)
{
    struct controller *controller = call->controller;
    const struct configuration *request = call->request;
    if (!quiet(controller))
        return STATUS_BUSY;
    if (!config_valid(request, &call->value))
        return STATUS_OUT_OF_RANGE;
    controller->config.current = *request;
    controller_apply_config(controller);
    return STATUS_OK;
}

static enum status handle_save_config(struct call *call)
{
    struct controller *controller = call->controller;
    if (!quiet(controller))
        return STATUS_BUSY;
    return config_save(&controller->config, controller->port) ? STATUS_OK : STATUS_FLASH_FAILED;
}

static enum status handle_factory(struct call *call)
{
    struct controller *controller = call->controller;
    if (!quiet(controller))
        return STATUS_BUSY;
    config_factory(&controller->config);
    controller_apply_config(controller);
    return STATUS_OK;
}

static enum status restart(struct call *call, uint32_t expected, bool bootloader)
{
    struct controller *controller = call->controller;
    const struct magic *request = call->request;
    if (request->magic != expected)
        return refuse(call, STATUS_BAD_MAGIC, request->magic);
    controller_restart(controller, bootloader);
    return STATUS_OK;
}

static enum status handle_reset(struct call *call)
{
    return restart(call, RESET_MAGIC, false);
}

static enum status handle_bootloader(struct call *call)
{
    return restart(call, BOOTLOADER_MAGIC, true);
}

static enum status handle_selftest(struct call *call)
{
    const struct controller *controller = call->controller;
    const struct port *port = controller->port;
    struct self_test_reply *reply = call->reply;
    uint16_t tested = 0;
    uint32_t stack_free = 0;
    if (!quiet(controller))
        return STATUS_BUSY;
    reply->failed = port->selftest(port->context, &tested, &stack_free);
    reply->tested = tested;
    reply->stack_free = stack_free;
    reply->image_crc = port->identity.image_crc;
    return STATUS_OK;
}

#define ENTRY(NAME, name, request, reply) {COMMAND_##NAME, request, reply, handle_##name},
static const struct entry entries[] = {COMMANDS(ENTRY)};

static const struct entry *find(uint8_t code)
{
    for (size_t i = 0; i < sizeof entries / sizeof *entries; i++)
        if (entries[i].code == code)
            return &entries[i];
    return NULL;
}

static enum status execute(struct call *call, const struct packet *request, struct packet *reply)
{
    const struct entry *entry = find(request->type);
    struct counters_reply *counters = &call->controller->counters;
    if (!entry) {
        counters->unknown_command++;
        return refuse(call, STATUS_UNKNOWN_COMMAND, request->type);
    }
    if (request->count != entry->request_bytes) {
        counters->bad_length++;
        return refuse(call, STATUS_BAD_LENGTH, request->count);
    }
    enum status status = entry->handle(call);
    if (status == STATUS_OK)
        reply->count = (uint8_t)(reply->count + entry->reply_bytes);
    else
        counters->refused++;
    return status;
}

void controller_execute(struct controller *controller, const struct packet *request, struct packet *reply)
{
    struct reply_head *head = (struct reply_head *)reply->payload;
    struct call call = {.controller = controller, .request = request->payload, .reply = reply->payload + sizeof *head};
    reply->type = (uint8_t)(request->type | REPLY);
    reply->sequence = request->sequence;
    reply->count = sizeof *head;
    head->status = (uint8_t)execute(&call, request, reply);
    head->value = head->status == STATUS_OK ? 0 : call.value;
}
