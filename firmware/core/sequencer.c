#include "sequencer.h"

#include "bytes.h"
#include "crc.h"
#include "port.h"

uint32_t sequencer_table_crc(const struct sequencer_table *table, uint8_t step_count, uint8_t led_count)
{
    uint32_t crc = 0;
    for (uint32_t group = 0; group < GROUP_COUNT; group++)
        crc = crc32(crc, table->groups[group], 3u * led_count);
    return crc32(crc, table->steps, step_count * sizeof table->steps[0]);
}

static void take_over(struct sequencer *sequencer)
{
    bytes_copy(&sequencer->active, &sequencer->pending, sizeof sequencer->active);
    bytes_fill(&sequencer->next, 0, sizeof sequencer->next);
    sequencer->swap = false;
}

void sequencer_commit(struct sequencer *sequencer, uint8_t step_count, uint16_t loops)
{
    sequencer->staged.step_count = step_count;
    sequencer->staged.loops = loops;
    bytes_copy(&sequencer->pending, &sequencer->staged, sizeof sequencer->pending);
    if (sequencer->running)
        sequencer->swap = true;
    else
        take_over(sequencer);
}

void sequencer_start(struct sequencer *sequencer, uint64_t now_us)
{
    bytes_fill(&sequencer->next, 0, sizeof sequencer->next);
    bytes_fill(&sequencer->trim, 0, sizeof sequencer->trim);
    sequencer->fraction = 0;
    sequencer->due_us = now_us;
    sequencer->lit = false;
    sequencer->running = true;
}

void sequencer_stop(struct sequencer *sequencer)
{
    sequencer->running = false;
    sequencer->lit = false;
    if (sequencer->swap)
        take_over(sequencer);
}

/* Move the schedule on by a duration, stretched by the trim; the fraction is never lost. */
static void advance(struct sequencer *sequencer, uint32_t duration_us)
{
    int64_t stretched = ((int64_t)duration_us << 32) + (int64_t)duration_us * sequencer->trim.period;
    uint64_t sum = (uint64_t)stretched + sequencer->fraction;
    sequencer->fraction = (uint32_t)sum;
    sequencer->due_us += sum >> 32;
}

/* Shift the schedule once. Further back than the board has run would be a time in the far future: then at once. */
static void shift(struct sequencer *sequencer)
{
    int64_t phase_us = sequencer->trim.phase_us;
    sequencer->trim.phase_us = 0;
    if (phase_us < 0 && (uint64_t)-phase_us > sequencer->due_us)
        sequencer->due_us = 0;
    else
        sequencer->due_us += (uint64_t)phase_us;
}

/* All passes have been shown. */
static bool over(const struct sequencer *sequencer)
{
    return sequencer->active.loops && sequencer->next.loop >= sequencer->active.loops;
}

/* A pass has ended and the pending table is to begin. */
static bool swaps(const struct sequencer *sequencer)
{
    return sequencer->swap && !sequencer->lit && !sequencer->next.step && !sequencer->next.repetition;
}

/* Count on to the next showing. */
static void count_on(struct sequencer *sequencer)
{
    struct sequencer_position *next = &sequencer->next;
    if (++next->repetition < sequencer->active.steps[next->step].repeat)
        return;
    next->repetition = 0;
    if (++next->step < sequencer->active.step_count)
        return;
    next->step = 0;
    next->loop = (uint16_t)(next->loop + 1);
}

static const struct set_step *current(const struct sequencer *sequencer)
{
    return &sequencer->active.steps[sequencer->next.step];
}

static enum sequencer_next plan_lit(struct sequencer *sequencer, struct sequencer_plan *plan, uint64_t start_us)
{
    plan->at = sequencer->next;
    plan->at.group = current(sequencer)->group;
    plan->start_us = start_us;
    return SEQUENCER_LIT;
}

static enum sequencer_next plan_dark(struct sequencer_plan *plan, uint64_t start_us, enum sequencer_next what)
{
    plan->at = (struct sequencer_position){.step = NO_STEP, .group = NO_STEP};
    plan->start_us = start_us;
    return what;
}

static enum sequencer_next next_free(struct sequencer *sequencer, struct sequencer_plan *plan)
{
    const struct set_step *step = current(sequencer);
    if (sequencer->lit) {
        plan_dark(plan, sequencer->due_us, SEQUENCER_DARK);
        sequencer->lit = false;
        advance(sequencer, step->blank_us);
        count_on(sequencer);
        return SEQUENCER_DARK;
    }
    if (over(sequencer))
        return plan_dark(plan, sequencer->due_us, SEQUENCER_END);
    shift(sequencer);
    plan_lit(sequencer, plan, sequencer->due_us);
    advance(sequencer, step->dwell_us);
    if (step->blank_us)
        sequencer->lit = true;
    else
        count_on(sequencer);
    return SEQUENCER_LIT;
}

static enum sequencer_next next_triggered(struct sequencer *sequencer, struct sequencer_plan *plan)
{
    if (sequencer->lit) {
        sequencer->lit = false;
        return plan_dark(plan, sequencer->due_us, SEQUENCER_DARK);
    }
    if (!over(sequencer))
        return plan_lit(sequencer, plan, PORT_ON_TRIGGER);
    return plan_dark(plan, PORT_ON_TRIGGER, SEQUENCER_END);
}

enum sequencer_next sequencer_next(struct sequencer *sequencer, struct sequencer_plan *plan)
{
    if (swaps(sequencer))
        take_over(sequencer);
    return sequencer->mode == SYNC_MODE_FREE ? next_free(sequencer, plan) : next_triggered(sequencer, plan);
}

void sequencer_began(struct sequencer *sequencer, uint64_t first_bit_us)
{
    uint32_t dwell_us = current(sequencer)->dwell_us;
    if (sequencer->mode == SYNC_MODE_FREE)
        return;
    sequencer->due_us = first_bit_us + dwell_us;
    sequencer->lit = dwell_us != 0;
    count_on(sequencer);
}
