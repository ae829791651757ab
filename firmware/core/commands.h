/*
 * What each request does. A handler gets the request record, whose length has been checked, fills in the reply
 * record and returns a status; where it refuses, `value` says what.
 */
#ifndef GELLIGHT_COMMANDS_H
#define GELLIGHT_COMMANDS_H

#include "state.h"

struct call {
    struct controller *controller;
    const void *request;
    void *reply;
    uint32_t value;
};

#define DECLARE(NAME, name, request, reply) enum status handle_##name(struct call *call);
COMMANDS(DECLARE)
#undef DECLARE

/* Obey a packet and fill in the reply to it. */
void commands_execute(struct controller *controller, const struct packet *request, struct packet *reply);

static inline enum status refuse(struct call *call, enum status status, uint32_t value)
{
    call->value = value;
    return status;
}

static inline bool outside(struct call *call, uint32_t value, uint32_t low, uint32_t high)
{
    call->value = value;
    return value < low || value > high;
}

static inline bool running(const struct call *call)
{
    return call->controller->sequencer.running;
}

static inline bool quiet(const struct controller *controller)
{
    return !controller->sequencer.running && !controller->shown_shines && !controller->slot.busy &&
           !controller->still_wanted;
}

#endif
