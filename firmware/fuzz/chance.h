/* Random numbers of a fuzzer's mutator: whoever includes this sets `state`, not 0, and the seed decides everything. */
#ifndef CHANCE_H
#define CHANCE_H

#include <stdint.h>

static uint32_t state;

/* xorshift32 (Marsaglia 2003) */
static uint32_t chance(uint32_t below)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return (state >> 8) % below;
}

#endif
