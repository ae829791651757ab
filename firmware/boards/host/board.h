/*
 * The core as a library, for tests and for sim://: a board with a virtual clock, an ideal ring of LEDs, and faults on
 * demand. Nothing happens between two calls; board_advance() lets time pass.
 */
#ifndef GELLIGHT_BOARD_H
#define GELLIGHT_BOARD_H

#include "controller.h"
#include "thermistor.h"

#ifndef BOARD_LIGHTS /* that are remembered; the fuzzer needs few */
#define BOARD_LIGHTS 4096u
#define BOARD_OUTPUT_BYTES 65536u
#endif
#define BOARD_FLASH_BYTES (PORT_SECTORS * PORT_SECTOR_BYTES)

struct board_light {
    uint64_t first_bit_us;
    uint64_t latched_us;
    uint8_t wire[COLOUR_BYTES];
    uint32_t pulse_us; /* PORT_NO_PULSE: none */
};

struct board {
    struct controller controller;
    struct port port;
    uint64_t now_us;
    uint64_t tick_us;

    struct board_light light; /* on its way */
    bool waiting, on_trigger;
    uint16_t latch_us;
    uint32_t wire_us;

    struct board_light lights[BOARD_LIGHTS];
    uint32_t light_count;
    uint8_t output[BOARD_OUTPUT_BYTES];
    uint32_t output_count;
    uint8_t flash[BOARD_FLASH_BYTES];

    bool powered;        /* the load switch is closed */
    int16_t temperature; /* in 0.1 degrees Celsius */
    uint16_t thermistor; /* reading of the converter */

    bool listening, falling;
    bool restarted, bootloader;

    uint32_t room;          /* bytes that still fit */
    uint32_t reads_to_edge; /* readings of the clock until an edge comes, 0: none */
    bool stuck;             /* transfers break off */
    int32_t cut_after;      /* bytes programmed or erased until power fails; -1: never */
    bool powerless;
};

struct board *board_new(const uint8_t *flash, uint32_t saves); /* as noted before it restarted, 0: power came */
void board_free(struct board *board);
void board_identify(struct board *board, const uint8_t *unique_id);
void board_receive(struct board *board, const uint8_t *bytes, uint32_t count);
void board_advance(struct board *board, uint64_t duration_us);
void board_edge(struct board *board, bool falling);
void board_link(struct board *board, bool open, uint32_t reason);
uint32_t board_take_output(struct board *board, uint8_t *bytes, uint32_t room);
uint32_t board_light_count(const struct board *board);
void board_light_at(const struct board *board, uint32_t index, struct board_light *light);
void board_flash(const struct board *board, uint8_t *flash);
void board_fault(struct board *board, uint32_t room, bool stuck, int32_t cut_after);
void board_edge_after_reads(struct board *board, uint32_t reads);
void board_warm(struct board *board, int32_t temperature);
void board_warm_ring(struct board *board, uint32_t reading);
bool board_powered(const struct board *board);
uint32_t board_noted_saves(const struct board *board);
uint64_t board_now(const struct board *board);
uint64_t board_next(const struct board *board); /* until then nothing happens by itself */
uint32_t board_flags(const struct board *board); /* 1: healthy, 2: restarted, 4: into the boot loader */
uint32_t board_current_ua(const struct board *board); /* of the last light, by the model of the configuration */

#endif
