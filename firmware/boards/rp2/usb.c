/*
 * A full-speed CDC-ACM device on the USB controller of the RP2040 (data sheet 4.1). Endpoint 0 answers requests
 * (usb_control.c), endpoint 2 carries the bytes both ways; endpoint 1 is there because the class asks for it.
 *
 * Bytes for the host wait in a ring until it fetches them; an OUT packet is accepted only while there is room for a
 * whole one, so a host that floods the board is slowed down by the bus and nothing is lost.
 */
#include "byte_ring.h"
#include "usb_wire.h"

#define IN_OFFSET 0x180u
#define OUT_OFFSET 0x1c0u
#define NOTIFY_OFFSET 0x200u
#define ENDPOINT_CONTROL(endpoint, out) (USB_DPRAM + 8u * (endpoint) + ((out) ? 4u : 0u))
#define ENABLED (1u << 31 | 1u << 29) /* with an interrupt for each buffer */
#define HALT_BIT(endpoint) (1u << ((endpoint) & 15u) << ((endpoint) >> 7) * 4u)
#define BULK (2u << 26)
#define INTERRUPT (3u << 26)

/* INTE, INTS */
#define INTERRUPT_BUFFER (1u << 4)
#define INTERRUPT_RESET (1u << 12)
#define INTERRUPT_SUSPEND (1u << 14)
#define INTERRUPT_RESUME (1u << 15)
#define INTERRUPT_SETUP (1u << 16)
#define INTERRUPT_SOF (1u << 17)
/* SIE_STATUS */
#define STATUS_SUSPENDED (1u << 4)
#define STATUS_RESUME (1u << 11)
#define STATUS_SETUP (1u << 17)
#define STATUS_RESET (1u << 19)

#define BAUD_TOUCH 1200u
#define SOF_EVERY_US 50000u
#define HUNG_US 1000000u
#define PAUSED_US 10000000u /* with dark LEDs: so long a host may not read, whose program stands in a debugger */
#define UNPLUGGED_US 10000u /* long enough for any hub to notice */

/*
 * Erratum RP2040-E15: a bulk IN transfer near the end of a frame hangs the controller behind some hosts and hubs. None is
 * armed from 800 to 998 us after the start of a frame, and packets of 48 bytes at most are over sooner. They are shorter
 * than the endpoint allows too, so each ends a transfer, and the host never waits for the next one. A frame that was noted
 * 60 ms ago tells its place to 40 us (USB 2.0 allows the host 500 ppm, the crystal has 100), and interrupts of the light,
 * which come first, may hold up its note or the arming for as long again.
 */
#define IN_PACKET 48u
#define FRAME_US 1000u
#define FRAME_BEGINS_US 40u
#define FRAME_ENDS_US 700u

static struct byte_ring incoming, outgoing;
static bool configured;
static bool in_data1, out_data1, in_busy, out_armed;
static bool in_waiting;         /* for the next frame, or the end of a halt, before its packet is armed */
static uint32_t in_count;       /* bytes in the buffer that the host has not fetched */
static uint32_t halted; /* bits of endpoints that stall each transfer (USB 2.0, 9.4.5) */
static uint32_t progress_us;    /* low half of the time when something was queued, armed or came last */
static bool terminal_ready; /* DTR, as the host said last */
static volatile bool open;  /* and the bus is awake */
static volatile uint8_t events; /* bits of enum usb_event */
static uint32_t sof_us;         /* low half of the time when the frame began that was noted last */
static bool sof_noted;

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

/* ---- in the interrupt ---- */

void usb_note(enum usb_event what)
{
    events = (uint8_t)(events | what);
}

/* A closing stays noted when the port is opened again before the main loop looks, an opening before it does not. */
static void close_port(enum usb_event why)
{
    if (!open)
        return;
    open = false;
    ring_empty(&incoming);
    ring_empty(&outgoing);
    events = (uint8_t)(events & ~(uint32_t)USB_OPENED);
    usb_note(why);
}

bool data_halted(uint32_t endpoint)
{
    return halted & HALT_BIT(endpoint);
}

static void accept_packet(void)
{
    out_armed = configured && !data_halted(BULK_OUT) && RING_BYTES - ring_count(&incoming) >= PACKET;
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

/* Frames that began meanwhile, of which none knows when, are forgotten by the reading. */
static void await_frame(void)
{
    (void)REGISTER(USB_SOF_RD);
    SET_BITS(USB_INTE) = INTERRUPT_SOF;
}

/* One half of the clock is enough: nothing here asks about the time of an hour ago. */
static uint32_t now_us(void)
{
    return REGISTER(TIMER_TIMERAWL);
}

static bool frame_noted(uint32_t within_us)
{
    return sof_noted && now_us() - sof_us < within_us;
}

/* A frame that begins about now is waited for: it takes 40 us until that is certain, the next one a millisecond. */
static bool frame_allows(void)
{
    uint32_t since_us, place_us;
    if (!frame_noted(SOF_EVERY_US + 10000u))
        return false;
    do {
        since_us = now_us() - sof_us;
        place_us = since_us % FRAME_US;
    } while (since_us != place_us && place_us < FRAME_BEGINS_US);
    return place_us < FRAME_ENDS_US;
}

/* What is in the buffer already was taken back, by a halt that is over. */
static void arm_packet(void)
{
    if (!in_count)
        while (in_count < IN_PACKET && ring_count(&outgoing))
            dpram(USB_DPRAM + IN_OFFSET)[in_count++] = ring_get(&outgoing);
    in_waiting = false;
    in_busy = configured && in_count;
    if (!in_busy)
        return;
    progress_us = now_us();
    hand_over(BUFFER_CONTROL(2, false), in_count | FULL | LAST | (in_data1 ? DATA1 : 0));
    in_data1 = !in_data1;
}

static void send_packet(void)
{
    in_busy = in_waiting = configured && (in_count || ring_count(&outgoing));
    if (!in_busy || data_halted(BULK_IN))
        return;
    progress_us = now_us(); /* nothing has hung while there was nothing to send */
    if (frame_allows())
        arm_packet();
    else
        await_frame();
}

static void take_back(uint32_t endpoint, uint32_t answer)
{
    REGISTER(BUFFER_CONTROL(endpoint & 15u, endpoint == BULK_OUT)) = answer;
}

/* What is armed is taken back. */
void data_halt(uint32_t endpoint)
{
    halted |= HALT_BIT(endpoint);
    take_back(endpoint, STALL);
    if (endpoint == BULK_IN)
        in_waiting = in_busy;
    if (endpoint == BULK_OUT)
        out_armed = false;
}

/* The host begins anew with DATA0 (USB 2.0, 9.4.5), and what is armed has to expect it; no transfer goes on meanwhile. */
void data_clear_halt(uint32_t endpoint)
{
    halted &= ~HALT_BIT(endpoint);
    take_back(endpoint, 0);
    if (endpoint == BULK_OUT) {
        out_data1 = false;
        accept_packet();
    }
    if (endpoint == BULK_IN) {
        in_data1 = false;
        send_packet();
    }
}

static void open_port(void)
{
    if (!open)
        usb_note(USB_OPENED);
    open = true;
}

void data_configure(bool chosen)
{
    configured = chosen;
    terminal_ready = false;
    close_port(USB_CLOSED);
    if (!configured)
        return;
    REGISTER(ENDPOINT_CONTROL(1, false)) = ENABLED | INTERRUPT | NOTIFY_OFFSET;
    REGISTER(ENDPOINT_CONTROL(2, true)) = ENABLED | BULK | OUT_OFFSET;
    REGISTER(ENDPOINT_CONTROL(2, false)) = ENABLED | BULK | IN_OFFSET;
    take_back(NOTIFY_IN, 0);
    take_back(BULK_IN, 0); /* a packet from before must not be sent */
    in_data1 = out_data1 = in_busy = in_waiting = false;
    halted = in_count = 0;
    ring_empty(&incoming);
    ring_empty(&outgoing);
    accept_packet();
}

/* Opening at 1200 baud and closing again asks for the boot loader, as on many boards. */
void data_lines(bool ready, uint32_t baud)
{
    terminal_ready = ready;
    if (ready)
        open_port();
    else
        close_port(baud == BAUD_TOUCH ? USB_BOOTLOADER : USB_CLOSED);
}

static void bus_reset(void)
{
    control_reset();
    data_configure(false);
    join_begin();
}

/* A program that had the port open still has: the host says DTR no second time. */
static void resume(void)
{
    if (terminal_ready)
        open_port();
}

/* One frame is noted, and what waited for it is armed; then the interrupt is off until the next is asked for. */
static void start_of_frame(void)
{
    CLEAR_BITS(USB_INTE) = INTERRUPT_SOF;
    sof_us = now_us();
    sof_noted = true;
    (void)REGISTER(USB_SOF_RD); /* ends the interrupt */
    if (in_waiting && !data_halted(BULK_IN))
        arm_packet();
}

/* Their interrupt would come late, and the place in the frame be wrong: what waits for a frame waits for the next. */
void usb_frames_missed(void)
{
    (void)REGISTER(USB_SOF_RD);
}

static void fetched(void)
{
    in_count = 0;
    send_packet();
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
        fetched();
    if (done & 1u << 5)
        take_packet();
}

void usb_interrupt(void)
{
    uint32_t why = REGISTER(USB_INTS);
    if (why & (INTERRUPT_BUFFER | INTERRUPT_SETUP))
        progress_us = now_us();
    if (why & INTERRUPT_SOF) /* first: its time is what counts */
        start_of_frame();
    if (why & INTERRUPT_BUFFER)
        buffers_done();
    if (why & INTERRUPT_SETUP) {
        REGISTER(USB_SIE_STATUS) = STATUS_SETUP;
        control_setup();
    }
    if (why & INTERRUPT_RESET) {
        REGISTER(USB_SIE_STATUS) = STATUS_RESET;
        bus_reset();
    }
    if (why & INTERRUPT_SUSPEND) {
        REGISTER(USB_SIE_STATUS) = STATUS_SUSPENDED;
        close_port(USB_SUSPENDED);
    }
    if (why & INTERRUPT_RESUME) {
        REGISTER(USB_SIE_STATUS) = STATUS_RESUME;
        resume();
    }
}

/* ---- what the board calls ---- */

static void connect(void)
{
    for (uint32_t at = 0; at < 4096; at += 4)
        REGISTER(USB_DPRAM + at) = 0;
    REGISTER(USB_MUXING) = TO_PHY;
    REGISTER(USB_PWR) = 1u << 2 | 1u << 3;     /* VBUS is taken to be there */
    REGISTER(USB_MAIN_CTRL) = 1;               /* device */
    REGISTER(USB_SIE_CTRL) = 1u << 29;         /* interrupt for each buffer of endpoint 0 */
    REGISTER(USB_INTE) = INTERRUPT_BUFFER | INTERRUPT_RESET | INTERRUPT_SUSPEND | INTERRUPT_RESUME | INTERRUPT_SETUP;
    REGISTER(NVIC_ISER) = 1u << IRQ_USB;
    SET_BITS(USB_SIE_CTRL) = 1u << 16;         /* pull-up: here we are */
}

void usb_start(const uint8_t unique_id[8])
{
    usb_serial_number(unique_id);
    connect();
}

/*
 * A packet waits, frames begin, but nothing comes or goes: the controller hangs, and only its reset helps (RP2040-E15). A
 * host that just does not read looks the same, but for the time: it does so while its program is held up.
 */
void usb_watch(bool dark)
{
    lock();
    bool hung = open && in_busy && !data_halted(BULK_IN) && frame_noted(2u * SOF_EVERY_US) &&
                now_us() - progress_us > (dark ? PAUSED_US : HUNG_US);
    if (open && !frame_noted(SOF_EVERY_US))
        await_frame();
    if (!hung) {
        unlock();
        return;
    }
    data_configure(false);
    join_abandon();
    SET_BITS(RESETS_RESET) = RESET_USBCTRL;
    for (uint32_t begun_us = now_us(); now_us() - begun_us < UNPLUGGED_US;)
        ;
    CLEAR_BITS(RESETS_RESET) = RESET_USBCTRL;
    while (!(REGISTER(RESETS_DONE) & RESET_USBCTRL))
        ;
    control_reset();
    connect();
}

bool usb_send(void *context, const uint8_t *bytes, size_t count, size_t spare)
{
    (void)context;
    lock();
    bool fits = open && RING_BYTES - ring_count(&outgoing) >= count + spare;
    for (size_t i = 0; fits && i < count; i++)
        ring_put(&outgoing, bytes[i]);
    if (fits && !in_busy)
        send_packet();
    unlock();
    return fits;
}

size_t usb_receive(uint8_t *bytes, size_t room)
{
    size_t count = 0;
    lock(); /* also for the tail, which closing the port moves as well */
    while (count < room && ring_count(&incoming))
        bytes[count++] = ring_get(&incoming);
    if (!out_armed)
        accept_packet();
    unlock();
    return count;
}

uint32_t usb_events(void)
{
    lock();
    uint32_t what = events;
    events = 0;
    unlock();
    return what;
}
