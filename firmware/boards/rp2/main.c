/* The board: dark LEDs first, then USB, then one loop that sleeps when there is nothing to do. */
#include "board.h"
#include "registers.h"

#include "bytes.h"
#include "crc.h"
#include "lights.h"
#include "watches.h"

#define STACK_PAINT 0xa5u
#define RECEIVE_BYTES 64u

extern uint8_t stack_limit[], stack_end[];
static struct controller controller;
static struct port port;

static void stack_paint(void)
{
    uint32_t end = (uint32_t)__builtin_frame_address(0) - 64u;
    for (uint32_t at = (uint32_t)stack_limit; at < end; at += 4)
        *(volatile uint32_t *)at = STACK_PAINT * 0x01010101u;
}

static uint32_t stack_free(void)
{
    const uint8_t *at = stack_limit;
    while (at < stack_end && *at == STACK_PAINT)
        at++;
    return (uint32_t)(at - stack_limit);
}

static uint64_t port_micros(void *context)
{
    (void)context;
    return clock_micros();
}

static bool image_intact(void)
{
    const uint8_t *image = (const uint8_t *)(&image_header + 1);
    uint32_t crc = 0;
    for (uint32_t done = 0; done < image_header.count; done += 256u) {
        uint32_t left = image_header.count - done;
        crc = crc32(crc, image + done, left < 256u ? left : 256u);
        watchdog_feed();
    }
    return crc == image_header.crc;
}

static uint16_t port_selftest(void *context, uint16_t *tested, uint32_t *free_bytes)
{
    (void)context;
    *tested = CHECK_IMAGE | CHECK_LIGHT_PATH | CHECK_STACK;
    *free_bytes = stack_free();
    return (uint16_t)((image_intact() ? 0 : CHECK_IMAGE) | (light_path_intact() ? 0 : CHECK_LIGHT_PATH) |
                      (*free_bytes > 256 ? 0 : CHECK_STACK));
}

static void port_restart(void *context, bool bootloader)
{
    (void)context;
    if (bootloader)
        flash_bootloader();
    watchdog_restart(RESET_REASON_COMMAND);
}

static void port_setup(void *context, const struct configuration *configuration)
{
    (void)context;
    light_setup(configuration);
    pins_setup(configuration);
    thermistor_setup();
}

static void port_fill(void)
{
    port = (struct port){
        .setup = port_setup,
        .micros = port_micros,
        .send = usb_send,
        .pulse = light_pulse,
        .light = light_show,
        .light_cancel = light_cancel,
        .light_result = light_result,
        .power = pins_power,
        .trigger = pins_listen,
        .temperature = chip_temperature,
        .thermistor = thermistor_read,
        .flash_read = flash_read,
        .flash_erase = flash_erase,
        .flash_program = flash_program,
        .note_saves = watchdog_note_saves,
        .selftest = port_selftest,
        .restart = port_restart,
        .identity = {
            .board = THIS_BOARD,
            .reset_reason = watchdog_reset_reason(),
            .saves = watchdog_saves(),
            .capabilities =
                CAPABILITY_TRIGGER | CAPABILITY_FLASH | CAPABILITY_BOOTLOADER | CAPABILITY_TEMPERATURE,
            .image_crc = image_header.crc,
        },
    };
}

static void follow_bus(void)
{
    uint32_t happened = usb_events();
    if (happened & USB_CLOSED)
        controller_link(&controller, false, DARK_PORT_CLOSED);
    if (happened & USB_SUSPENDED)
        controller_link(&controller, false, DARK_SUSPENDED);
    if (happened & USB_BOOTLOADER)
        watches_restart(&controller, true);
    if (happened & USB_OPENED)
        controller_link(&controller, true, DARK_NOT_DARK);
}

/* Whether more bytes may wait. */
static bool serve_host(void)
{
    uint8_t bytes[RECEIVE_BYTES];
    size_t count = usb_receive(bytes, sizeof bytes);
    for (size_t i = 0; i < count; i++)
        controller_receive(&controller, bytes[i]);
    return count == sizeof bytes;
}

/* Every interrupt since the last sleep has set the event register, so none is slept through, and none is held off. */
static void sleep_until_something_happens(void)
{
    __asm volatile("wfe" ::: "memory");
}

int main(void)
{
    vectors_install();
    clock_start();
    stack_paint();
    port_fill();
    light_trigger = &controller.trigger;
    controller_start(&controller, &port);
    flash_unique_id(port.identity.unique_id);
    usb_start(port.identity.unique_id);
    for (;;) {
        follow_bus();
        bool more = serve_host();
        usb_watch(!lights_will_shine(&controller));
        controller_poll(&controller);
        if (tick_passed()) {
            status_show(&controller);
            if (controller_healthy(&controller))
                watchdog_feed();
        }
        if (!more)
            sleep_until_something_happens();
    }
}
