/* The boot ROM's functions, and the flash while it does not answer reads. */
#ifndef FLASH_H
#define FLASH_H

#include <stdint.h>

typedef void procedure(void);

struct access {
    procedure *connect, *leave_xip, *flush, *enter_xip;
    uint32_t interrupts;
};

/* A function of the boot ROM by its two letters: each chip has its own way to find it. */
void *rom_function(char first, char second);

/* Between these two the flash takes commands: nothing runs from it, and interrupts are off. */
struct access access_begin(void);
void access_end(const struct access *access);

#endif
