/*
 * What the board remembers without power: records appended to two flash sectors, the newest valid one counts.
 *
 *   record = one page | magic u32 | saves u32 | struct configuration | 0xff ... | CRC-32 u32 |
 *
 * A page is written once and never changed; a sector is erased only when the other one is full, and only the one
 * that does not hold the newest record. So a power cut loses at most the record that was being written.
 */
#ifndef GELLIGHT_CONFIG_H
#define GELLIGHT_CONFIG_H

#include <stdbool.h>
#include <stdint.h>

#include "port.h"
#include "protocol.h"

/* of a board as it comes */
#define DATA_PIN 2u
#define TRIGGER_PIN 3u
#define STATUS_PIN 25u

struct config {
    struct configuration current; /* in force */
    struct configuration stored;  /* in flash */
    uint32_t saves;               /* of the newest record, 0: there is none */
    uint32_t retries;             /* writes that did not read back */
    uint16_t page;                /* of the newest record, counted over both sectors */
};

void config_load(struct config *config, const struct port *port);
void config_factory(struct config *config);

/* The first field that is out of range, as its value in *value; true if all are well. */
bool config_valid(const struct configuration *candidate, uint32_t *value);

/* The same for what takes a confirmation (SET_SUPPLY) to change: nothing that the supply or the LEDs may not stand. */
bool config_unconfirmed(const struct configuration *now, const struct configuration *candidate, uint32_t *value);

/* Whether the current configuration is in flash. */
bool config_stored(const struct config *config);

/* Write the current configuration unless it is stored already; false if the flash does not take it. */
bool config_save(struct config *config, const struct port *port);

#endif
