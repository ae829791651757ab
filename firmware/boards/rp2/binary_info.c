/*
 * What `picotool info` shows of an image: name, version, pins. The layout is that of the pico-sdk (binary_info/structure.h):
 * a header within 256 bytes of the first vectors, entries, texts, all in flash.
 */
#include "board.h"

#include "version.h"

#define MARKER_START 0x7188ebf2u
#define MARKER_END 0xe71aa390u
#define OF_RASPBERRY_PI 0x5052u /* "RP" */
#define TEXT 6u
#define PINS 9u
#define PROGRAM_NAME 0x02031c86u
#define PROGRAM_VERSION 0x11a9bc3au
#define IN_FLASH(what) __attribute__((section(".binary_info" what), used)) static const

/* of a text: which, and where it is; of pins: which, and the place of their name */
struct entry {
    uint16_t type, tag;
    uint32_t what;
    const char *text;
};

_Static_assert(FIRMWARE_MAJOR < 10 && FIRMWARE_MINOR < 10 && FIRMWARE_PATCH < 10, "one digit each");
IN_FLASH("_text") char version[] = {'0' + FIRMWARE_MAJOR, '.', '0' + FIRMWARE_MINOR, '.', '0' + FIRMWARE_PATCH, 0};
IN_FLASH("_text") char name[] = "GelLight light ring";
IN_FLASH("_text") char data[] = "LEDs (default)";
IN_FLASH("_text") char trigger[] = "trigger (default)";
IN_FLASH("_text") char status[] = "status LED (default)";

IN_FLASH("_entries") struct entry entries[] = {
    {TEXT, OF_RASPBERRY_PI, PROGRAM_NAME, name},
    {TEXT, OF_RASPBERRY_PI, PROGRAM_VERSION, version},
    {PINS, OF_RASPBERRY_PI, 1u << DATA_PIN, data},
    {PINS, OF_RASPBERRY_PI, 1u << TRIGGER_PIN, trigger},
    {PINS, OF_RASPBERRY_PI, 1u << STATUS_PIN, status},
};
IN_FLASH("_list") struct entry *const list[] = {&entries[0], &entries[1], &entries[2], &entries[3], &entries[4]};
IN_FLASH("_moved") uint32_t moved[3]; /* nothing of it is copied to RAM */

IN_FLASH("_header") struct {
    uint32_t start;
    const struct entry *const *first, *const *end;
    const uint32_t *moved;
    uint32_t stop;
} header = {MARKER_START, list, list + sizeof list / sizeof *list, moved, MARKER_END};
