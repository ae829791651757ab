/*
 * The only road from the core to the hardware. A board fills in this struct; the core calls nothing else.
 *
 * Times are microseconds since the start of the board. All functions are called from one context (the main loop);
 * the board may transfer a light from its interrupts.
 */
#ifndef GELLIGHT_PORT_H
#define GELLIGHT_PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct configuration;

/* start_us of a light that waits for the trigger instead of a time */
#define PORT_ON_TRIGGER UINT64_MAX
#define PORT_NO_PULSE UINT32_MAX

/* flash of the configuration: two sectors that erase to 0xff, written in pages */
#define PORT_SECTORS 2u
#define PORT_SECTOR_BYTES 4096u
#define PORT_PAGE_BYTES 256u

enum port_light {
    PORT_LIGHT_NONE,    /* no transfer since the last result was read */
    PORT_LIGHT_WAITING, /* its time or its trigger has not come, or its latch time is not over; or it broke off */
    PORT_LIGHT_LATCHED, /* the LEDs show it; reported once */
};

struct port_identity {
    uint8_t board;        /* enum board_kind */
    uint8_t reset_reason; /* enum reset_reason */
    uint8_t saves;        /* as noted last by note_saves(), 15 at most; 0 after power came */
    uint8_t unique_id[8];
    uint32_t capabilities; /* bits of enum capability */
    uint32_t image_crc;
};

struct port {
    void *context;

    /* Before all else: the pins, and what hangs at them. */
    void (*setup)(void *context, const struct configuration *configuration);

    uint64_t (*micros)(void *context);

    /* Queue bytes for the host; false, and nothing queued, if they do not all fit and leave `spare` bytes of room. */
    bool (*send)(void *context, const uint8_t *bytes, size_t count, size_t spare);

    /* Transfer the bytes to the LEDs at start_us (in the past: at once). Only called while none is waiting. */
    void (*light)(void *context, const uint8_t *wire, uint64_t start_us, uint16_t latch_us);
    /* The trigger output pulses after_us after the first bit of the next light, once it is latched. */
    void (*pulse)(void *context, uint32_t after_us);
    /* Take a waiting light back; false if its transfer has begun, which is never torn. */
    bool (*light_cancel)(void *context);
    enum port_light (*light_result)(void *context, uint64_t *first_bit_us, uint64_t *latched_us);

    /* Close or open the load switch of the LEDs, where there is one; open at the start. */
    void (*power)(void *context, bool closed);

    /* Which edge of the trigger pin the board passes to trigger_edge(); listen only if enabled. */
    void (*trigger)(void *context, bool enabled, bool falling);

    /* Of the chip, in 0.1 degrees Celsius; NO_TEMPERATURE without a sensor. */
    int16_t (*temperature)(void *context);
    /* Of the converter at the ring's NTC (thermistor.h); THERMISTOR_OPEN or more: there is none. */
    uint16_t (*thermistor)(void *context);

    void (*flash_read)(void *context, uint32_t offset, void *to, size_t count);
    bool (*flash_erase)(void *context, uint32_t sector);
    bool (*flash_program)(void *context, uint32_t offset, const uint8_t page[PORT_PAGE_BYTES]);

    /* How many saves of the configuration count as used, or restarts would make them unlimited. */
    void (*note_saves)(void *context, uint8_t saves);

    /* Self-test of what the core cannot see: bits of enum check. */
    uint16_t (*selftest)(void *context, uint16_t *tested, uint32_t *stack_free);
    /* Start anew, or start the boot loader; called once the reply is on its way. */
    void (*restart)(void *context, bool bootloader);

    struct port_identity identity;
};

#endif
