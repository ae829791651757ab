/*
 * The light ring as a whole: bytes from the host go in, lights and replies come out, and nothing stays lit that no
 * host wants any more. The board calls controller_receive() for each byte, controller_link() when the connection
 * comes or goes, and controller_poll() whenever anything happened and at least every 10 ms.
 */
#ifndef GELLIGHT_CONTROLLER_H
#define GELLIGHT_CONTROLLER_H

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
    uint8_t role;      /* enum sequencer_next: what it is to the sequence; SEQUENCER_WAIT: nothing */
};

struct controller {
    const struct port *port;
    struct packet_receiver receiver;
    struct packet request; /* the last one that was executed, for repeats */
    bool request_kept;
    uint8_t reply[PACKET_WIRE_BYTES];
    size_t reply_count;

    struct config config;
    struct ring_limits limits;
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
    uint32_t step_id; /* of the light that the last STEP asked for */
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
    bool silent;          /* the host was silent for so long that the LEDs were darkened */
    uint64_t reported_us; /* when telemetry was sent last */
    uint64_t restart_us;  /* 0: no restart was asked for */
    uint16_t telemetry_ms;
    bool restart_bootloader;
    uint8_t event_sequence;
    struct counters_reply counters;
};

/* Start with dark LEDs; the light that makes them so is under way when this returns. */
void controller_start(struct controller *controller, const struct port *port);
void controller_receive(struct controller *controller, uint8_t byte);
void controller_link(struct controller *controller, bool open, enum dark reason);
void controller_restart(struct controller *controller, bool bootloader);
void controller_poll(struct controller *controller);

/* False when a light is overdue or does not get through: then the board must not feed its watchdog. */
bool controller_healthy(const struct controller *controller);

/* For the commands, the events and the watches. */
uint64_t controller_now_us(const struct controller *controller);
void controller_end_sequence(struct controller *controller);
void controller_go_dark(struct controller *controller, enum dark reason);
void controller_darken(struct controller *controller, enum dark reason); /* by a fault: counted and told */
void controller_withdraw(struct controller *controller);                 /* the light that waits, unless it has begun */
bool controller_will_shine(const struct controller *controller);
void controller_watch(struct controller *controller);
bool controller_above_limit(const struct controller *controller);
void controller_show(struct controller *controller, const uint8_t colours[COLOUR_BYTES]);
void controller_apply_config(struct controller *controller);
void controller_status(const struct controller *controller, struct status_reply *status);
void controller_execute(struct controller *controller, const struct packet *request, struct packet *reply);

#endif
