/*
 * What the light ring knows of itself, for everything that stands above: lights.c, events.c, watches.c, the commands and
 * controller.c.
 */
#ifndef GELLIGHT_STATE_H
#define GELLIGHT_STATE_H

#include <stdbool.h>
#include <stdint.h>

#include "config.h"
#include "heat.h"
#include "packet.h"
#include "port.h"
#include "protocol.h"
#include "ring.h"
#include "sequencer.h"
#include "supply.h"
#include "trigger.h"

/* The one light that has been handed to the board and is not latched yet. */
struct controller_slot {
    uint8_t wire[COLOUR_BYTES];
    uint8_t colours[COLOUR_BYTES]; /* before they are dimmed */
    struct sequencer_position at;
    uint64_t start_us;
    uint32_t light_id;
    uint16_t current_ma;
    uint8_t dimmed; /* how often its colours are halved */
    bool busy;
    bool shines;       /* any LED is lit */
    uint32_t pulse_us; /* of the trigger output, from the first bit on */
    uint8_t role;      /* enum sequencer_next: what it is to the sequence; SEQUENCER_NONE: nothing */
};

/* 100 000 erases of either sector take three years at one save a minute. */
#define SAVES_AHEAD_US ((SAVES_AT_ONCE - 1u) * SAVE_EVERY_US)

struct controller {
    const struct port *port;
    struct packet_receiver receiver;
    struct packet request; /* the last one that was executed, for repeats */
    bool request_kept;
    uint8_t reply[PACKET_WIRE_BYTES];
    size_t reply_count;

    struct config config;
    uint64_t saves_us; /* until then saves would be spread at their rate: at most SAVES_AHEAD_US from now */
    struct ring_limits limits;
    struct ring_limits granted; /* the limits at the start: until the next one no command goes beyond them */
    struct sequencer sequencer;
    struct trigger trigger;
    struct set_sync sync;
    uint8_t colour_order; /* as it was at the start, like the pins and the number of LEDs */
    bool pulse_middle;

    struct heat heat;
    struct supply supply;

    struct controller_slot slot;
    uint8_t still[COLOUR_BYTES]; /* what SET_LEDS or a safety rule wants next */
    uint32_t still_id;
    bool still_wanted;
    bool still_again; /* it is what is lit, dimmed otherwise */
    uint32_t next_id;

    struct sequencer_position shown;
    uint32_t shown_id;
    uint16_t shown_ma;
    bool shown_shines;
    uint8_t shown_dimmed;
    uint8_t shown_colours[COLOUR_BYTES]; /* before they were dimmed */
    uint8_t dark; /* enum dark */

    uint64_t packet_us;   /* when the last valid packet came */
    bool open;            /* somebody listens */
    bool silent;          /* the host was silent, and the LEDs were darkened */
    uint64_t restart_us;  /* 0: no restart was asked for */
    bool restart_bootloader;
    uint8_t event_sequence;
    struct counters_reply counters;
};

static inline uint64_t controller_now_us(const struct controller *controller)
{
    return controller->port->micros(controller->port->context);
}

#endif
