/*
 * Endpoint 0: the requests of USB 2.0 (9.4) that a device with one configuration has to know, and those of a CDC-ACM serial
 * port (PSTN 1.2, 6.3). What is not known is refused by a stall.
 */
#include "usb_wire.h"

#define EP0_BUFFER (USB_DPRAM + 0x100u)

/* bmRequestType */
#define TO_HOST 0x80u
#define CLASS_OR_VENDOR 0x60u
#define TO_DEVICE 0x00u
#define TO_STANDARD_INTERFACE 0x01u
#define TO_ENDPOINT 0x02u
#define OF_INTERFACE 0x81u
#define OF_ENDPOINT 0x82u
#define TO_INTERFACE 0x21u   /* a request of its class */
#define FROM_INTERFACE 0xa1u

/* bRequest */
#define GET_STATUS 0u
#define CLEAR_FEATURE 1u
#define SET_FEATURE 3u
#define SET_ADDRESS 5u
#define GET_DESCRIPTOR 6u
#define GET_CONFIGURATION 8u
#define SET_CONFIGURATION 9u
#define GET_INTERFACE 10u
#define SET_INTERFACE 11u
#define SET_LINE_CODING 0x20u
#define GET_LINE_CODING 0x21u
#define SET_CONTROL_LINE_STATE 0x22u
#define SEND_BREAK 0x23u

#define LAST_ADDRESS 127u
#define NO_ADDRESS 0xffu
#define SERIAL_INTERFACE 0u
#define DATA_INTERFACE 1u

struct setup {
    uint8_t type, request;
    uint16_t value, index, count;
};

static struct setup setup;
static const uint8_t *control_bytes; /* still to be sent */
static uint16_t control_count;
static bool control_zero; /* and then an empty packet */
static bool control_data1;
static bool expect_line_coding;
static uint8_t new_address = NO_ADDRESS, configuration;
static uint8_t line_coding[7] = {0x00, 0xc2, 0x01, 0x00, 0, 0, 8}; /* 115200 8N1 */

static void control_in(uint16_t count)
{
    hand_over(BUFFER_CONTROL(0, false), count | FULL | LAST | (control_data1 ? DATA1 : 0));
    control_data1 = !control_data1;
}

static void control_out(uint16_t count)
{
    hand_over(BUFFER_CONTROL(0, true), count | LAST | DATA1);
}

static void control_continue(void)
{
    uint16_t count = control_count < PACKET ? control_count : (uint16_t)PACKET;
    for (uint16_t i = 0; i < count; i++)
        dpram(EP0_BUFFER)[i] = *control_bytes++;
    control_count = (uint16_t)(control_count - count);
    if (count < PACKET)
        control_zero = false;
    control_in(count);
}

static void control_reply(const uint8_t *bytes, uint16_t count)
{
    control_bytes = bytes;
    control_count = count < setup.count ? count : setup.count;
    control_zero = control_count < setup.count && control_count % PACKET == 0;
    control_continue();
}

static void control_accept(void)
{
    control_in(0);
}

static void control_refuse(void)
{
    REGISTER(USB_EP_STALL_ARM) = 3; /* endpoint 0, IN and OUT */
    REGISTER(BUFFER_CONTROL(0, false)) = STALL;
    REGISTER(BUFFER_CONTROL(0, true)) = STALL;
}

static void get_descriptor(void)
{
    uint16_t count;
    const uint8_t *bytes = usb_descriptor((uint8_t)(setup.value >> 8), (uint8_t)setup.value, &count);
    if (bytes)
        control_reply(bytes, count);
    else
        control_refuse();
}

static bool endpoint_0(void)
{
    return (setup.index & ~0x80u) == 0;
}

/* Interfaces, and endpoints besides 0, are there once a configuration is chosen (9.4.5). */
static bool interface_known(void)
{
    return configuration && setup.index <= DATA_INTERFACE;
}

static bool endpoint_known(void)
{
    return endpoint_0() ||
           (configuration && (setup.index == NOTIFY_IN || setup.index == BULK_OUT || setup.index == BULK_IN));
}

/* The only feature that is known: the halt of an endpoint, value 0. Endpoint 0 is never halted. */
static void endpoint_feature(void)
{
    bool halt = setup.request == SET_FEATURE;
    if (setup.value || !endpoint_known() || (halt && endpoint_0())) {
        control_refuse();
        return;
    }
    control_accept();
    if (halt)
        data_halt(setup.index);
    else if (!endpoint_0())
        data_clear_halt(setup.index);
}

/* Of device and interface: bus powered, and nothing else. */
static void get_status(void)
{
    static uint8_t status[2];
    bool of_endpoint = setup.type == OF_ENDPOINT;
    if ((of_endpoint && !endpoint_known()) || (setup.type == OF_INTERFACE && !interface_known())) {
        control_refuse();
        return;
    }
    status[0] = of_endpoint && data_halted(setup.index);
    control_reply(status, sizeof status);
}

/* Each interface has the one setting 0; choosing it resets the toggles of its endpoints (9.1.1.5). */
static void interface_setting(void)
{
    static const uint8_t only[1];
    if (!interface_known() || setup.value) {
        control_refuse();
    } else if (setup.request == GET_INTERFACE) {
        control_reply(only, 1);
    } else {
        control_accept();
        if (setup.index == DATA_INTERFACE) {
            data_clear_halt(BULK_IN);
            data_clear_halt(BULK_OUT);
        }
    }
}

static void standard_request(void)
{
    if (setup.type == TO_HOST && setup.request == GET_DESCRIPTOR) {
        get_descriptor();
    } else if (setup.type == TO_DEVICE && setup.request == SET_ADDRESS && setup.value <= LAST_ADDRESS) {
        new_address = (uint8_t)setup.value; /* takes effect after the status stage */
        control_accept();
    } else if (setup.type == TO_DEVICE && setup.request == SET_CONFIGURATION && setup.value <= 1) {
        configuration = (uint8_t)setup.value;
        control_accept();
        data_configure(configuration);
    } else if (setup.type == TO_HOST && setup.request == GET_CONFIGURATION) {
        control_reply(&configuration, 1);
    } else if (setup.type == TO_ENDPOINT && (setup.request == CLEAR_FEATURE || setup.request == SET_FEATURE)) {
        endpoint_feature();
    } else if ((setup.type == OF_INTERFACE && setup.request == GET_INTERFACE) ||
               (setup.type == TO_STANDARD_INTERFACE && setup.request == SET_INTERFACE)) {
        interface_setting();
    } else if (setup.request == GET_STATUS && setup.type >= TO_HOST && setup.type <= OF_ENDPOINT) {
        get_status();
    } else {
        control_refuse();
    }
}

static void set_control_lines(void)
{
    uint32_t baud = (uint32_t)line_coding[0] | (uint32_t)line_coding[1] << 8 | (uint32_t)line_coding[2] << 16;
    control_accept();
    data_lines(setup.value & 1u, baud);
}

/* A host that sends what nobody takes would wait for ever; only the line coding comes with bytes, and always with 7. */
static bool bytes_expected(void)
{
    bool coding = setup.type == TO_INTERFACE && setup.request == SET_LINE_CODING;
    return setup.type & TO_HOST || setup.count == (coding ? sizeof line_coding : 0u);
}

static void interface_request(void)
{
    if (setup.type == TO_INTERFACE && setup.request == SET_LINE_CODING && setup.index == SERIAL_INTERFACE) {
        expect_line_coding = true;
        control_out(sizeof line_coding);
    } else if (setup.type == TO_INTERFACE && setup.request == SET_CONTROL_LINE_STATE &&
               setup.index == SERIAL_INTERFACE) {
        set_control_lines();
    } else if (setup.type == TO_INTERFACE && setup.request == SEND_BREAK && setup.index == SERIAL_INTERFACE) {
        control_accept(); /* nobody listens to it */
    } else if (setup.type == FROM_INTERFACE && setup.request == GET_LINE_CODING && setup.index == SERIAL_INTERFACE) {
        control_reply(line_coding, sizeof line_coding);
    } else {
        control_refuse();
    }
}

/* What is armed belongs to a transfer that the host has given up: it may not answer the next. */
static void control_abort(void)
{
    REGISTER(BUFFER_CONTROL(0, false)) = 0;
    REGISTER(BUFFER_CONTROL(0, true)) = 0;
    control_count = 0;
    control_zero = false;
    expect_line_coding = false;
    new_address = NO_ADDRESS;
}

void control_setup(void)
{
    const volatile uint8_t *bytes = dpram(USB_DPRAM);
    setup.type = bytes[0];
    setup.request = bytes[1];
    setup.value = (uint16_t)(bytes[2] | bytes[3] << 8);
    setup.index = (uint16_t)(bytes[4] | bytes[5] << 8);
    setup.count = (uint16_t)(bytes[6] | bytes[7] << 8);
    control_abort();
    control_data1 = true;
    if (!bytes_expected())
        control_refuse();
    else if (setup.type & CLASS_OR_VENDOR)
        interface_request();
    else
        standard_request();
}

void control_sent(void)
{
    if (new_address != NO_ADDRESS) { /* 0 is one too: back to the state before enumeration (9.4.6) */
        REGISTER(USB_ADDR_ENDP) = new_address;
        new_address = NO_ADDRESS;
    }
    if (control_count || control_zero) {
        if (!control_count)
            control_zero = false;
        control_continue();
    } else if (setup.type & TO_HOST) {
        control_out(0); /* status stage */
    }
}

void control_received(void)
{
    if (!expect_line_coding)
        return;
    expect_line_coding = false;
    if ((REGISTER(BUFFER_CONTROL(0, true)) & COUNT) != sizeof line_coding) {
        control_refuse();
        return;
    }
    for (uint32_t i = 0; i < sizeof line_coding; i++)
        line_coding[i] = dpram(EP0_BUFFER)[i];
    control_data1 = true;
    control_accept();
}

void control_reset(void)
{
    REGISTER(USB_ADDR_ENDP) = 0;
    configuration = 0;
    control_abort();
}
