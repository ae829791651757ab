/*
 * The load switch of the LEDs, where one is fitted: closed before the first light, open while all is dark. Its pin is
 * not driven at the start, after a fault and without power, which leaves it open.
 */
#ifndef GELLIGHT_SUPPLY_H
#define GELLIGHT_SUPPLY_H

#include <stdbool.h>
#include <stdint.h>

#include "port.h"

struct supply {
    bool fitted;
    bool closed;
    uint64_t settled_us; /* no light before this time: the capacitors of the LEDs are charged by then */
};

void supply_close(struct supply *supply, const struct port *port);
void supply_open(struct supply *supply, const struct port *port);

#endif
