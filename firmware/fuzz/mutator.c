/*
 * Changes to a story (target.c) that keep it one: acts put in, whole stories cut, bytes changed. libFuzzer calls this,
 * and so does driver.c. Half of the requests have fields that the board accepts, or nothing would ever run.
 */
#include <string.h>

#include "chance.h"
#include "story.h"

#define ACT_BYTES 128u

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t room);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed);

#define LENGTH(NAME, name, request, reply) {COMMAND_##NAME, request},
static const struct {
    uint8_t code, bytes;
} requests[] = {COMMANDS(LENGTH)};

/* Of the board as it comes: a request has 3 bytes for each of its LEDs. */
static void dim(uint8_t colours[COLOUR_BYTES])
{
    for (uint32_t i = 0; i < 3u * LED_COUNT; i++)
        colours[i] = (uint8_t)(chance(3) ? 0 : chance(256));
}

static uint32_t duration_us(void)
{
    return chance(2) ? 0 : DWELL_MIN_US + chance(20000);
}

/* Fields within their ranges, for the requests that have some. */
static void fill_well(uint8_t code, void *payload)
{
    struct set_leds *leds = payload;
    struct set_group *group = payload;
    if (code == COMMAND_SET_LEDS)
        dim(leds->colours);
    if (code == COMMAND_SET_GROUP) {
        group->group = (uint8_t)chance(3);
        dim(group->colours);
    }
    if (code == COMMAND_SET_STEP)
        *(struct set_step *)payload = (struct set_step){
            .step = (uint8_t)chance(3), .group = (uint8_t)chance(3), .repeat = (uint16_t)(1u + chance(2)),
            .dwell_us = duration_us(), .blank_us = duration_us()};
    if (code == COMMAND_SET_SYNC)
        *(struct set_sync *)payload = (struct set_sync){
            .mode = (uint8_t)chance(2), .edge = (uint8_t)chance(2), .divider = (uint16_t)(1u + chance(2)),
            .delay_us = duration_us(), .timeout_us = duration_us()};
    if (code == COMMAND_SET_CONFIG)
        *(struct configuration *)payload = (struct configuration){
            .host_timeout_ms = (uint16_t)(100u + chance(2000)), .limit_ma = (uint16_t)(100u + chance(351)),
            .quiescent_ua = (uint16_t)chance(5001), .channel_ua = 20000, .latch_us = 300,
            .unused = (uint8_t)chance(2), .data_pin = 2, .trigger_pin = (uint8_t)(3u + chance(2)),
            .led_count = (uint8_t)(1u + chance(24)), .colour_order = (uint8_t)chance(3),
            .status_pin = (uint8_t)(chance(2) ? NO_PIN : 25u), .output_pin = (uint8_t)(chance(2) ? NO_PIN : 4u),
            .output_at = (uint8_t)chance(2), .switch_pin = (uint8_t)(chance(2) ? NO_PIN : 6u),
            .hottest_c = (uint8_t)(40u + chance(46))};
    if (code == COMMAND_SET_SUPPLY)
        *(struct set_supply *)payload = (struct set_supply){
            .magic = SUPPLY_MAGIC, .channel_ua = (uint16_t)(CHANNEL_LEAST_UA + chance(20000)),
            .external_supply = (uint8_t)chance(2)};
    if (code == COMMAND_RESET)
        *(struct magic *)payload = (struct magic){.magic = RESET_MAGIC};
    if (code == COMMAND_TRIM)
        *(struct trim *)payload = (struct trim){.phase_us = (int32_t)chance(8000) - 4000, .period = 1000};
}

static size_t write_request(uint8_t act[ACT_BYTES])
{
    uint32_t which = chance(sizeof requests / sizeof *requests), variety = chance(4);
    uint8_t fill = (uint8_t)chance(256), bytes = requests[which].bytes, code = requests[which].code;
    if (variety && (code == COMMAND_SET_LEDS || code == COMMAND_SET_GROUP))
        bytes = (uint8_t)(bytes - COLOUR_BYTES + 3u * LED_COUNT);
    act[0] = ACT_REQUEST;
    act[1] = bytes;
    act[2] = requests[which].code;
    for (uint32_t i = 0; i < bytes; i++)
        act[3 + i] = variety ? fill : (uint8_t)chance(256);
    if (variety > 1)
        fill_well(act[2], act + 3);
    return 3u + bytes;
}

static size_t write_act(uint8_t act[ACT_BYTES])
{
    static const uint8_t kinds[] = {ACT_TIME, ACT_TRIGGER, ACT_TRIGGER, ACT_LINK, ACT_FAULT, ACT_COMMIT, ACT_COMMIT,
                                    ACT_HEAT};
    size_t count = 0;
    if (chance(2))
        return write_request(act);
    act[count++] = kinds[chance(sizeof kinds)];
    act[count++] = (uint8_t)chance(chance(2) ? 256 : 8);
    return count;
}

static size_t insert(uint8_t *data, size_t size, size_t room, size_t at)
{
    uint8_t act[ACT_BYTES];
    size_t count = write_act(act);
    if (count > room - size)
        return size;
    memmove(data + at + count, data + at, size - at);
    memcpy(data + at, act, count);
    return size + count;
}

/* Where the act with this number begins; the end of the story where there are fewer. */
static size_t find(const uint8_t *data, size_t size, uint32_t number)
{
    size_t at = 0;
    for (size_t took = 1; number && took && at < size; number--, at += took)
        took = story_act_bytes(data + at, size - at);
    return at < size ? at : size;
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed)
{
    state = seed | 1u;
    for (uint32_t i = 0, changes = 1u + chance(8); i < changes; i++) {
        uint32_t what = chance(8);
        if (what == 0)
            size = LLVMFuzzerMutate(data, size, room);
        else if (what == 1)
            size = find(data, size, chance(64));
        else
            size = insert(data, size, room, find(data, size, chance(what < 5 ? 64u : 4u)));
    }
    return size;
}
