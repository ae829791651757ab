/*
 * A full-speed CDC-ACM device on the USB controller of the RP2040 (data sheet 4.1). Endpoint 0 answers requests,
 * endpoint 2 carries the bytes both ways; endpoint 1 is there because the class asks for it.
 *
 * Bytes for the host wait in a ring until it fetches them; an OUT packet is accepted only while there is room for a
 * whole one, so a host that floods the board is slowed down by the bus and nothing is lost.
 */
#include "board.h"
#include "byte_ring.h"
#include "registers.h"

#define FULL (1u << 15)
#define LAST (1u << 14)
#define DATA1 (1u << 13)
#define STALL (1u << 11)
#define AVAILABLE (1u << 10)
#define COUNT 0x3ffu
#define PACKET 64u

#define EP0_BUFFER (USB_DPRAM + 0x100u)
#define IN_OFFSET 0x180u
#define OUT_OFFSET 0x1c0u
#define NOTIFY_OFFSET 0x200u
#define ENDPOINT_CONTROL(endpoint, out) (USB_DPRAM + 8u * (endpoint) + ((out) ? 4u : 0u))
#define BUFFER_CONTROL(endpoint, out) (USB_DPRAM + 0x80u + 8u * (endpoint) + ((out) ? 4u : 0u))
#define ENABLED (1u << 31 | 1u << 29) /* with an interrupt for each buffer */
#define BULK (2u << 26)
#define INTERRUPT (3u << 26)

#define INTERRUPT_BUFFER (1u << 4)
#define INTERRUPT_RESET (1u << 12)
#define INTERRUPT_SUSPEND (1u << 14)
#define INTERRUPT_SETUP (1u << 16)

#define BAUD_TOUCH 1200u

struct setup {
    uint8_t type, request;
    uint16_t value, index, count;
};

static struct byte_ring incoming, outgoing;
static struct setup setup;
static const uint8_t *control_bytes; /* still to be sent on endpoint 0 */
static uint16_t control_count;
static bool control_zero; /* and then an empty packet */
static bool control_data1, in_data1, out_data1;
static bool expect_line_coding, in_busy, out_armed;
static uint8_t new_address, configured;
static uint8_t line_coding[7] = {0x00, 0xc2, 0x01, 0x00, 0, 0, 8}; /* 115200 8N1 */
static volatile bool open;
static volatile uint8_t event;

static volatile uint8_t *dpram(uint32_t address)
{
    return (volatile uint8_t *)address;
}

/* AVAILABLE goes last and 12 cycles of clk_usb later than the rest (4.1.2.5.1). */
static void hand_over(uint32_t control, uint32_t value)
{
    REGISTER(control) = value;
    __asm volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop");
    REGISTER(control) = value | AVAILABLE;
}

/* Only the interrupt of USB is held off: that of the light may never wait. */
static void lock(void)
{
    REGISTER(NVIC_ICER) = 1u << IRQ_USB;
    __asm volatile("dsb\n isb" ::: "memory");
}

static void unlock(void)
{
    __asm volatile("" ::: "memory");
    REGISTER(NVIC_ISER) = 1u << IRQ_USB;
}

static void note(enum usb_event what)
{
    event = (uint8_t)what;
}

static void close_port(enum usb_event why)
{
    if (!open)
        return;
    open = false;
    outgoing.tail = outgoing.head;
    note(why);
}

/* ---- endpoint 0 ---- */

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
    REGISTER(USB_EP_STALL_ARM) = 3;
    REGISTER(BUFFER_CONTROL(0, false)) = STALL;
    REGISTER(BUFFER_CONTROL(0, true)) = STALL;
}

/* ---- endpoint 2 ---- */

static void accept_packet(void)
{
    out_armed = configured && RING_BYTES - ring_count(&incoming) >= PACKET;
    if (!out_armed)
        return;
    hand_over(BUFFER_CONTROL(2, true), PACKET | LAST | (out_data1 ? DATA1 : 0));
    out_data1 = !out_data1;
}

static void take_packet(void)
{
    uint32_t count = REGISTER(BUFFER_CONTROL(2, true)) & COUNT;
    for (uint32_t i = 0; i < count; i++)
        ring_put(&incoming, dpram(USB_DPRAM + OUT_OFFSET)[i]);
    accept_packet();
}

static void send_packet(void)
{
    uint32_t count = ring_count(&outgoing) < PACKET ? ring_count(&outgoing) : PACKET;
    in_busy = configured && count;
    if (!in_busy)
        return;
    for (uint32_t i = 0; i < count; i++)
        dpram(USB_DPRAM + IN_OFFSET)[i] = ring_get(&outgoing);
    hand_over(BUFFER_CONTROL(2, false), count | FULL | LAST | (in_data1 ? DATA1 : 0));
    in_data1 = !in_data1;
}

static void configure(void)
{
    configured = (uint8_t)setup.value;
    control_accept();
    if (!configured) {
        close_port(USB_CLOSED);
        return;
    }
    REGISTER(ENDPOINT_CONTROL(1, false)) = ENABLED | INTERRUPT | NOTIFY_OFFSET;
    REGISTER(ENDPOINT_CONTROL(2, true)) = ENABLED | BULK | OUT_OFFSET;
    REGISTER(ENDPOINT_CONTROL(2, false)) = ENABLED | BULK | IN_OFFSET;
    in_data1 = out_data1 = in_busy = false;
    incoming.tail = incoming.head;
    outgoing.tail = outgoing.head;
    accept_packet();
}

/* ---- requests ---- */

static void get_descriptor(void)
{
    uint16_t count;
    const uint8_t *bytes = usb_descriptor((uint8_t)(setup.value >> 8), (uint8_t)setup.value, &count);
    if (bytes)
        control_reply(bytes, count);
    else
        control_refuse();
}

/* Opening at 1200 baud and closing again asks for the boot loader, as on many boards. */
static void set_control_lines(void)
{
    bool asked = setup.value & 1u;
    uint32_t baud = (uint32_t)line_coding[0] | (uint32_t)line_coding[1] << 8 | (uint32_t)line_coding[2] << 16;
    control_accept();
    if (asked && !open)
        note(USB_OPENED);
    else if (!asked)
        close_port(baud == BAUD_TOUCH ? USB_BOOTLOADER : USB_CLOSED);
    open = asked;
}

static void standard_request(void)
{
    static const uint8_t nothing[2];
    if (setup.type == 0x80 && setup.request == 6) {
        get_descriptor();
    } else if (setup.type == 0x00 && setup.request == 5) {
        new_address = (uint8_t)setup.value; /* takes effect after the status stage */
        control_accept();
    } else if (setup.type == 0x00 && setup.request == 9 && setup.value <= 1) {
        configure();
    } else if (setup.type == 0x80 && setup.request == 8) {
        control_reply(&configured, 1);
    } else if (setup.request == 0 && setup.type >= 0x80 && setup.type <= 0x82) {
        control_reply(nothing, 2);
    } else {
        control_refuse();
    }
}

static void class_request(void)
{
    if (setup.type == 0x21 && setup.request == 0x20 && setup.index == 0) {
        expect_line_coding = true;
        control_out(sizeof line_coding);
    } else if (setup.type == 0x21 && setup.request == 0x22 && setup.index == 0) {
        set_control_lines();
    } else if (setup.type == 0xa1 && setup.request == 0x21 && setup.index == 0) {
        control_reply(line_coding, sizeof line_coding);
    } else if (setup.type == 0x21 && setup.index == 2 && (setup.request == 1 || setup.request == 2)) {
        note(setup.request == 1 ? USB_BOOTLOADER : USB_RESTART);
        control_accept();
    } else {
        control_refuse();
    }
}

static void take_setup(void)
{
    const volatile uint8_t *bytes = dpram(USB_DPRAM);
    setup.type = bytes[0];
    setup.request = bytes[1];
    setup.value = (uint16_t)(bytes[2] | bytes[3] << 8);
    setup.index = (uint16_t)(bytes[4] | bytes[5] << 8);
    setup.count = (uint16_t)(bytes[6] | bytes[7] << 8);
    control_data1 = true;
    control_count = 0;
    control_zero = false;
    expect_line_coding = false;
    if (setup.type & 0x60)
        class_request();
    else
        standard_request();
}

static void control_sent(void)
{
    if (new_address) {
        REGISTER(USB_ADDR_ENDP) = new_address;
        new_address = 0;
    }
    if (control_count || control_zero) {
        if (!control_count)
            control_zero = false;
        control_continue();
    } else if (setup.type & 0x80) {
        control_out(0); /* status stage */
    }
}

static void control_received(void)
{
    if (!expect_line_coding)
        return;
    expect_line_coding = false;
    for (uint32_t i = 0; i < sizeof line_coding; i++)
        line_coding[i] = dpram(EP0_BUFFER)[i];
    control_data1 = true;
    control_accept();
}

static void bus_reset(void)
{
    REGISTER(USB_ADDR_ENDP) = 0;
    configured = 0;
    new_address = 0;
    close_port(USB_CLOSED);
}

static void buffers_done(void)
{
    uint32_t done = REGISTER(USB_BUFF_STATUS);
    REGISTER(USB_BUFF_STATUS) = done;
    if (done & 1u << 0)
        control_sent();
    if (done & 1u << 1)
        control_received();
    if (done & 1u << 4)
        send_packet();
    if (done & 1u << 5)
        take_packet();
}

void usb_interrupt(void)
{
    uint32_t why = REGISTER(USB_INTS);
    if (why & INTERRUPT_BUFFER)
        buffers_done();
    if (why & INTERRUPT_SETUP) {
        REGISTER(USB_SIE_STATUS) = 1u << 17;
        take_setup();
    }
    if (why & INTERRUPT_RESET) {
        REGISTER(USB_SIE_STATUS) = 1u << 19;
        bus_reset();
    }
    if (why & INTERRUPT_SUSPEND) {
        REGISTER(USB_SIE_STATUS) = 1u << 4;
        close_port(USB_SUSPENDED);
    }
}

/* ---- what the board calls ---- */

void usb_start(const uint8_t unique_id[8])
{
    usb_serial_number(unique_id);
    for (uint32_t at = 0; at < 4096; at += 4)
        REGISTER(USB_DPRAM + at) = 0;
    REGISTER(USB_MUXING) = 1u << 0 | 1u << 3;  /* to the pins, software connect */
    REGISTER(USB_PWR) = 1u << 2 | 1u << 3;     /* VBUS is taken to be there */
    REGISTER(USB_MAIN_CTRL) = 1;               /* device */
    REGISTER(USB_SIE_CTRL) = 1u << 29;         /* interrupt for each buffer of endpoint 0 */
    REGISTER(USB_INTE) = INTERRUPT_BUFFER | INTERRUPT_RESET | INTERRUPT_SUSPEND | INTERRUPT_SETUP;
    REGISTER(NVIC_ISER) = 1u << IRQ_USB;
    SET_BITS(USB_SIE_CTRL) = 1u << 16;         /* pull-up: here we are */
}

bool usb_send(void *context, const uint8_t *bytes, size_t count)
{
    (void)context;
    lock();
    bool fits = open && RING_BYTES - ring_count(&outgoing) >= count;
    for (size_t i = 0; fits && i < count; i++)
        ring_put(&outgoing, bytes[i]);
    if (fits && !in_busy)
        send_packet();
    unlock();
    return fits;
}

uint16_t usb_start_of_frame(void *context, uint64_t *at_us)
{
    (void)context;
    *at_us = 0; /* its time is not kept */
    return (uint16_t)(REGISTER(USB_SOF_RD) & 0x7ffu);
}

size_t usb_receive(uint8_t *bytes, size_t room)
{
    size_t count = 0;
    while (count < room && ring_count(&incoming))
        bytes[count++] = ring_get(&incoming);
    lock();
    if (!out_armed)
        accept_packet();
    unlock();
    return count;
}

enum usb_event usb_event(void)
{
    lock();
    enum usb_event what = (enum usb_event)event;
    event = USB_NOTHING;
    unlock();
    return what;
}
