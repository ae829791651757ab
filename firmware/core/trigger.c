#include "trigger.h"

bool trigger_edge(struct trigger *trigger, uint64_t now_us)
{
    trigger->last_us = (uint32_t)now_us;
    if (++trigger->edges < trigger->divider)
        return false;
    trigger->edges = 0;
    trigger->count++;
    if (!trigger->armed) {
        trigger->missed++;
        return false;
    }
    trigger->armed = false;
    trigger->start_us = now_us + trigger->delay_us;
    trigger->released = true;
    return true;
}

void trigger_arm(struct trigger *trigger)
{
    trigger->released = false;
    trigger->armed = true;
}

/* Once nothing is armed no edge releases it any more, so the order of the two lines decides every race. */
bool trigger_disarm(struct trigger *trigger)
{
    trigger->armed = false;
    return !trigger->released;
}

void trigger_restart(struct trigger *trigger, uint64_t now_us)
{
    trigger->edges = 0;
    trigger->armed = false;
    trigger->last_us = (uint32_t)now_us;
}
