/*
 * The trigger pin of EXT mode. trigger_edge() runs in the interrupt of the pin; everything else in the main loop.
 * A step is armed by the main loop and released by the edge that counts.
 */
#ifndef GELLIGHT_TRIGGER_H
#define GELLIGHT_TRIGGER_H

#include <stdbool.h>
#include <stdint.h>

struct trigger {
    uint32_t delay_us;
    uint16_t divider;
    volatile uint16_t edges; /* since the last one that counted */
    volatile uint32_t count; /* edges that counted */
    volatile uint32_t missed;
    volatile uint32_t last_us; /* low half of the time of the last edge */
    volatile bool armed;
    volatile bool released;     /* the armed step was released by an edge */
    volatile uint64_t start_us; /* of that step; stays until another is armed */
};

/* Note an edge; true if the armed light is to start at start_us. */
bool trigger_edge(struct trigger *trigger, uint64_t now_us);

void trigger_arm(struct trigger *trigger);

/* Take the arming back; false if an edge was first: then the light is on its way and stays so. */
bool trigger_disarm(struct trigger *trigger);

void trigger_restart(struct trigger *trigger, uint64_t now_us);

#endif
