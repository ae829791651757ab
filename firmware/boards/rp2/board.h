/* The parts of the board and what they offer each other. */
#ifndef GELLIGHT_RP2_BOARD_H
#define GELLIGHT_RP2_BOARD_H

#include "controller.h"

struct image_header {
    uint32_t magic;
    uint32_t count;
    uint32_t crc;
    uint32_t family;
};
extern const struct image_header image_header;

/* start.c */
#define START_CODE __attribute__((section(".start_code"))) /* in flash: what runs before the image is in RAM */
void vectors_install(void);

/* clock.c */
void clock_raise(void); /* in flash */
void clock_start(void);
uint64_t clock_micros(void);
void tick_interrupt(void);
bool tick_passed(void); /* since it was asked last */

/* thermometers.c */
int16_t chip_temperature(void *context);
void thermistor_setup(void);
uint16_t thermistor_read(void *context);

/* watchdog.c */
void watchdog_start(void); /* in flash */
void start_fault(void);    /* in flash */
uint8_t watchdog_reset_reason(void);
uint8_t watchdog_saves(void); /* as noted before a restart */
void watchdog_note_saves(void *context, uint8_t saves);
void watchdog_feed(void);
void watchdog_forget(void); /* that it runs: what restarts the chip from now on is not the watchdog */
void watchdog_pause(void); /* for the time of a flash operation */
void watchdog_restart(uint8_t reason);
void fault(void);

/* light.c */
void light_setup(const struct configuration *configuration);
void light_show(void *context, const uint8_t *wire, uint64_t start_us, uint16_t latch_us);
bool light_cancel(void *context);
enum port_light light_result(void *context, uint64_t *first_bit_us, uint64_t *latched_us);
bool light_path_intact(void);
void light_force_dark(void);
void light_pulse(void *context, uint32_t after_us);
void light_interrupt(void);
void trigger_interrupt(void);
extern struct trigger *light_trigger;

/* pins.c */
void pins_setup(const struct configuration *configuration);
void pins_listen(void *context, bool enabled, bool falling);
void pins_acknowledge(void); /* the edge of the trigger */
void pins_pulse(uint32_t after_us); /* the trigger output, once that time has passed; PORT_NO_PULSE: not, also what waits */
void pulse_interrupt(void);
void pins_power(void *context, bool closed); /* the load switch of the LEDs */
void status_show(const struct controller *controller); /* often: the status LED */

/* usb.c */
void usb_start(const uint8_t unique_id[8]);
bool usb_send(void *context, const uint8_t *bytes, size_t count, size_t spare);
size_t usb_receive(uint8_t *bytes, size_t room);
void usb_interrupt(void);
void usb_frames_missed(void); /* those that began while interrupts were off */
void usb_watch(bool dark); /* often: notes frames, and resets a controller that hangs; later where the LEDs are dark */

/* What happened on the bus since it was asked last: bits. An opening came after all else. */
enum usb_event {
    USB_OPENED = 1u << 0,
    USB_CLOSED = 1u << 1,
    USB_SUSPENDED = 1u << 2,
    USB_BOOTLOADER = 1u << 3,
};
uint32_t usb_events(void);

/* usb_join.c; of a chip that joins by itself: nothing */
void join_interrupt(void);

/* usb_descriptors.c */
const uint8_t *usb_descriptor(uint8_t type, uint8_t index, uint16_t *count);
void usb_serial_number(const uint8_t unique_id[8]);

/* flash.c, and rom.c of each chip */
void flash_unique_id(uint8_t unique_id[8]);
void flash_read(void *context, uint32_t offset, void *to, size_t count);
bool flash_erase(void *context, uint32_t sector);
bool flash_program(void *context, uint32_t offset, const uint8_t *page);
void flash_bootloader(void);

#endif
