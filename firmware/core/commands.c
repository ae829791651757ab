#include "commands.h"

#include "bytes.h"
#include "events.h"
#include "lights.h"
#include "version.h"
#include "watches.h"

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

enum status handle_hello(struct call *call)
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
    reply->led_count = call->controller->limits.led_count;
    reply->group_count = GROUP_COUNT;
    reply->step_count = STEP_COUNT;
    reply->packet_bytes = PACKET_BYTES;
    reply->tick_hz = TICK_HZ;
    reply->image_crc = identity->image_crc;
    return STATUS_OK;
}

enum status handle_clock(struct call *call)
{
    const struct controller *controller = call->controller;
    const struct port *port = controller->port;
    const struct clock_request *request = call->request;
    struct clock_reply *reply = call->reply;
    reply->host_us = request->host_us;
    reply->received_us = controller->packet_us;
    reply->sent_us = port->micros(port->context);
    return STATUS_OK;
}

enum status handle_status(struct call *call)
{
    status_now(call->controller, call->reply);
    return STATUS_OK;
}

enum status handle_counters(struct call *call)
{
    struct controller *controller = call->controller;
    controller->counters.triggers = controller->trigger.count;
    controller->counters.triggers_missed = controller->trigger.missed;
    controller->counters.flash_retries = controller->config.retries;
    bytes_copy(call->reply, &controller->counters, sizeof controller->counters);
    return STATUS_OK;
}

enum status handle_get_config(struct call *call)
{
    bytes_copy(call->reply, &call->controller->config.current, sizeof(struct configuration));
    return STATUS_OK;
}

static void take_effect(struct controller *controller)
{
    ring_configure(&controller->limits, &controller->config.current);
    ring_bound(&controller->limits, &controller->granted);
}

enum status handle_set_config(struct call *call)
{
    struct controller *controller = call->controller;
    struct configuration *current = &controller->config.current;
    const struct configuration *request = call->request;
    if (!quiet(controller))
        return STATUS_BUSY;
    if (!config_unconfirmed(current, request, &call->value) || !config_valid(request, &call->value))
        return STATUS_OUT_OF_RANGE;
    *current = *request;
    take_effect(controller);
    return STATUS_OK;
}

enum status handle_set_supply(struct call *call)
{
    struct controller *controller = call->controller;
    const struct set_supply *request = call->request;
    struct configuration changed = controller->config.current;
    if (request->magic != SUPPLY_MAGIC)
        return refuse(call, STATUS_BAD_MAGIC, request->magic);
    if (!quiet(controller))
        return STATUS_BUSY;
    changed.external_supply = request->external_supply;
    changed.channel_ua = request->channel_ua;
    if (!changed.external_supply && changed.limit_ma > CURRENT_CAP_MA)
        changed.limit_ma = CURRENT_CAP_MA;
    if (!config_valid(&changed, &call->value))
        return STATUS_OUT_OF_RANGE;
    controller->config.current = changed;
    take_effect(controller);
    return STATUS_OK;
}

/* Seconds until the flash may be written again; 0: now, and one of the saves that are allowed is used. */
static uint32_t save_in_s(struct controller *controller)
{
    const struct port *port = controller->port;
    uint64_t now_us = controller_now_us(controller);
    uint64_t from_us = controller->saves_us > now_us ? controller->saves_us : now_us;
    uint32_t ahead_us = (uint32_t)(from_us - now_us);
    if (ahead_us > SAVES_AHEAD_US)
        return (ahead_us - SAVES_AHEAD_US + 999999u) / 1000000u;
    controller->saves_us = from_us + SAVE_EVERY_US;
    port->note_saves(port->context, (uint8_t)((ahead_us + 2u * SAVE_EVERY_US - 1u) / SAVE_EVERY_US));
    return 0;
}

enum status handle_save_config(struct call *call)
{
    struct controller *controller = call->controller;
    if (!quiet(controller))
        return STATUS_BUSY;
    if (config_stored(&controller->config))
        return STATUS_OK;
    uint32_t wait_s = save_in_s(controller);
    if (wait_s)
        return refuse(call, STATUS_SAVED_TOO_OFTEN, wait_s);
    return config_save(&controller->config, controller->port) ? STATUS_OK : STATUS_FLASH_FAILED;
}

static enum status restart(struct call *call, uint32_t expected, bool bootloader)
{
    struct controller *controller = call->controller;
    const struct magic *request = call->request;
    if (request->magic != expected)
        return refuse(call, STATUS_BAD_MAGIC, request->magic);
    watches_restart(controller, bootloader);
    return STATUS_OK;
}

enum status handle_reset(struct call *call)
{
    return restart(call, RESET_MAGIC, false);
}

enum status handle_bootloader(struct call *call)
{
    return restart(call, BOOTLOADER_MAGIC, true);
}

enum status handle_selftest(struct call *call)
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

/* Colours end a request, 3 bytes for each LED there is. */
static uint32_t request_bytes(const struct controller *controller, const struct entry *entry)
{
    bool colours = entry->code == COMMAND_SET_LEDS || entry->code == COMMAND_SET_GROUP;
    return entry->request_bytes - (colours ? COLOUR_BYTES - 3u * controller->limits.led_count : 0u);
}

static enum status execute(struct call *call, const struct packet *request, struct packet *reply)
{
    const struct entry *entry = find(request->type);
    struct counters_reply *counters = &call->controller->counters;
    if (!entry) {
        counters->unknown_command++;
        return refuse(call, STATUS_UNKNOWN_COMMAND, request->type);
    }
    if (request->count != request_bytes(call->controller, entry)) {
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

void commands_execute(struct controller *controller, const struct packet *request, struct packet *reply)
{
    struct reply_head *head = (struct reply_head *)reply->payload;
    struct call call = {.controller = controller, .request = request->payload, .reply = reply->payload + sizeof *head};
    reply->type = (uint8_t)(request->type | REPLY);
    reply->sequence = request->sequence;
    reply->count = sizeof *head;
    head->status = (uint8_t)execute(&call, request, reply);
    head->value = head->status == STATUS_OK ? 0 : call.value;
}
