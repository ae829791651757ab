/*
 * Light groups in time. The sequencer only says which light comes next and when; it knows no hardware.
 *
 * A pass shows step 0 `repeat` times, step 1 `repeat` times and so on; each showing is lit for dwell_us and, in FREE
 * mode, dark for blank_us. In EXT a showing begins with the trigger; it is lit for dwell_us, or until the next one if
 * dwell_us is 0. What ends the last pass is the next trigger after it.
 */
#ifndef GELLIGHT_SEQUENCER_H
#define GELLIGHT_SEQUENCER_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

struct sequencer_table {
    uint8_t groups[GROUP_COUNT][COLOUR_BYTES];
    struct set_step steps[STEP_COUNT];
    uint16_t loops;
    uint8_t step_count;
};

/* Where a sequence is: which showing of which step in which pass. */
struct sequencer_position {
    uint16_t loop;
    uint16_t repetition;
    uint8_t step;
    uint8_t group;
};

enum sequencer_next {
    SEQUENCER_NONE, /* no part of a sequence */
    SEQUENCER_LIT,  /* the next light is planned */
    SEQUENCER_DARK, /* darkness is planned */
    SEQUENCER_END,  /* darkness is planned; once it is latched the sequence is to be stopped */
};

struct sequencer_plan {
    struct sequencer_position at;
    uint64_t start_us; /* PORT_ON_TRIGGER: at the next edge */
};

struct sequencer {
    struct sequencer_table staged;  /* what SET_GROUP and SET_STEP change */
    struct sequencer_table pending; /* committed while a pass runs: nothing that is staged later gets in */
    struct sequencer_table active;
    struct sequencer_position next;
    struct trim trim;
    uint64_t due_us;       /* when the next change is due (FREE) or the lit step ends (EXT) */
    uint32_t fraction;     /* of a microsecond, carried from one duration to the next, in 2^-32 */
    uint8_t mode;          /* enum sync_mode */
    bool running;
    bool swap;             /* the pending table takes over when this pass ends */
    bool lit;              /* a showing is on and its end is still to be planned */
};

uint32_t sequencer_table_crc(const struct sequencer_table *table, uint8_t step_count, uint8_t led_count);

/* Take over the staged table as it is now, at once or at the end of the running pass. */
void sequencer_commit(struct sequencer *sequencer, uint8_t step_count, uint16_t loops);
void sequencer_start(struct sequencer *sequencer, uint64_t now_us);
void sequencer_stop(struct sequencer *sequencer);

/* Say what comes next; to be called again only when that has been latched. */
enum sequencer_next sequencer_next(struct sequencer *sequencer, struct sequencer_plan *plan);

/* EXT: tell when the showing began, from which its dwell counts. */
void sequencer_began(struct sequencer *sequencer, uint64_t first_bit_us);

#endif
