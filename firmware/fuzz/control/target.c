/*
 * Control transfers, as a host sends them that knows no manners, to endpoint 0 of the RP2040's USB device; the registers
 * are plain memory at their places. One input is a list of acts:
 *
 *   0 s s s s s s s s   a SETUP packet, whatever goes on
 *   1                   the host takes what is armed on IN
 *   2 n                 the host sends n % 65 bytes, where OUT is armed
 *   3                   the host resets the bus
 *
 * After each act: no more is sent than was asked for, packets have 64 bytes at most, their toggles alternate, a request
 * is answered or refused, and the address changes only once its status stage is over.
 */
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "../chance.h"
#include "usb_wire.h"

#define SETUP_BYTES 8u
#define ACTS 4u
#define MOST_OUT 64u

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed);
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t room);

static const uint8_t known[][SETUP_BYTES] = {
    {0x80, 6, 0, 1, 0, 0, 64, 0},   {0x80, 6, 0, 1, 0, 0, 18, 0},  {0x80, 6, 0, 2, 0, 0, 9, 0},   {0x80, 6, 0, 2, 0, 0, 255, 0},
    {0x80, 6, 0, 3, 0, 0, 255, 0},  {0x80, 6, 1, 3, 9, 4, 255, 0}, {0x80, 6, 3, 3, 9, 4, 64, 0},  {0, 5, 7, 0, 0, 0, 0, 0},
    {0, 9, 1, 0, 0, 0, 0, 0},       {0x80, 8, 0, 0, 0, 0, 1, 0},   {2, 1, 0, 0, 0x82, 0, 0, 0},   {2, 1, 0, 0, 2, 0, 0, 0},
    {0x81, 10, 0, 0, 1, 0, 1, 0},   {1, 11, 0, 0, 1, 0, 0, 0},     {0x80, 0, 0, 0, 0, 0, 2, 0},   {0x21, 0x20, 0, 0, 0, 0, 7, 0},
    {0x21, 0x22, 3, 0, 0, 0, 0, 0}, {0xa1, 0x21, 0, 0, 0, 0, 7, 0}, {0x21, 0x23, 10, 0, 0, 0, 0, 0}, {0, 5, 0, 0, 0, 0, 0, 0},
    {2, 3, 0, 0, 0x82, 0, 0, 0},    {0x82, 0, 0, 0, 2, 0, 2, 0},
};

static bool chosen, open;
static uint32_t wanted, sent, armed_toggle;
static uint8_t address, asked_address;
static bool reads, in_transfer;

static void require(bool holds)
{
    if (!holds)
        abort();
}

/* ---- what endpoint 0 asks of the rest of the device ---- */

void data_configure(bool configured)
{
    chosen = configured;
}

void data_lines(bool ready, uint32_t baud)
{
    require(baud <= 0xffffffu);
    open = ready;
}

static bool halted;

void data_halt(uint32_t endpoint)
{
    require(in_transfer && (endpoint == NOTIFY_IN || endpoint == BULK_OUT || endpoint == BULK_IN));
    halted = true;
}

void data_clear_halt(uint32_t endpoint)
{
    require(in_transfer && (endpoint == NOTIFY_IN || endpoint == BULK_OUT || endpoint == BULK_IN));
    halted = false;
}

bool data_halted(uint32_t endpoint)
{
    return halted && endpoint & 15u;
}

void usb_note(enum usb_event what)
{
    (void)what;
}

/* ---- the host ---- */

static uint32_t buffer(bool out)
{
    return REGISTER(BUFFER_CONTROL(0, out));
}

static void check_armed(void)
{
    uint32_t in = buffer(false), out = buffer(true);
    require((in & COUNT) <= PACKET && (out & COUNT) <= PACKET);
    require(!in_transfer || ((in | out) & (AVAILABLE | STALL)));
    require(!(in & AVAILABLE) || !(out & AVAILABLE));
    require(REGISTER(USB_ADDR_ENDP) == address);
}

static void send_setup(const uint8_t *setup)
{
    memcpy((void *)(uintptr_t)USB_DPRAM, setup, SETUP_BYTES);
    reads = setup[0] & 0x80;
    wanted = (uint32_t)(setup[6] | setup[7] << 8);
    sent = 0;
    armed_toggle = DATA1;
    asked_address = address;
    if (setup[0] == 0 && setup[1] == 5 && setup[2] < 128 && !setup[3])
        asked_address = setup[2];
    in_transfer = true;
    control_setup();
}

static void take(void)
{
    uint32_t in = buffer(false);
    if (!(in & AVAILABLE))
        return;
    require((in & DATA1) == armed_toggle);
    armed_toggle ^= DATA1;
    sent += in & COUNT;
    require(sent <= wanted);
    if (!reads) { /* its status stage */
        address = asked_address;
        in_transfer = false;
    }
    REGISTER(BUFFER_CONTROL(0, false)) = in & ~AVAILABLE;
    control_sent();
}

static void give(uint8_t amount)
{
    uint32_t out = buffer(true);
    if (!(out & AVAILABLE))
        return;
    memset((void *)(uintptr_t)(USB_DPRAM + 0x100u), amount, amount % (MOST_OUT + 1u));
    REGISTER(BUFFER_CONTROL(0, true)) = (out & ~(AVAILABLE | COUNT)) | amount % (MOST_OUT + 1u);
    in_transfer = !reads;
    control_received();
}

static void reset(void)
{
    address = 0;
    in_transfer = false;
    control_reset();
}

static void map_registers(void)
{
    static const uint32_t blocks[] = {USB_DPRAM, USB_BASE};
    for (uint32_t i = 0; i < 2; i++) {
        void *place = (void *)(uintptr_t)blocks[i];
        require(mmap(place, 0x4000, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) == place);
    }
    usb_serial_number((const uint8_t *)"12345678");
}

/* How many bytes an act takes; 0 where it is not whole. */
static size_t act_bytes(const uint8_t *act, size_t left)
{
    static const uint8_t counts[ACTS] = {1 + SETUP_BYTES, 1, 2, 1};
    size_t count = left ? counts[act[0] % ACTS] : 0;
    return count > left ? 0 : count;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool mapped;
    if (!mapped)
        map_registers();
    mapped = true;
    reset();
    for (size_t at = 0, took; (took = act_bytes(data + at, size - at)) != 0; at += took) {
        switch (data[at] % ACTS) {
        case 0:
            send_setup(data + at + 1);
            break;
        case 1:
            take();
            break;
        case 2:
            give(data[at + 1]);
            break;
        default:
            reset();
        }
        check_armed();
    }
    return 0;
}

static size_t write_act(uint8_t act[1 + SETUP_BYTES])
{
    act[0] = (uint8_t)(chance(32) ? chance(3) : 3u);
    if (act[0] == 0)
        memcpy(act + 1, known[chance(sizeof known / sizeof *known)], SETUP_BYTES);
    if (act[0] == 0 && !chance(3))
        act[1 + chance(SETUP_BYTES)] = (uint8_t)chance(256);
    if (act[0] == 2)
        act[1] = (uint8_t)(chance(2) ? 7 : chance(256));
    return act_bytes(act, 1 + SETUP_BYTES);
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t room, unsigned int seed)
{
    uint8_t act[1 + SETUP_BYTES];
    state = seed | 1u;
    if (!chance(8))
        return LLVMFuzzerMutate(data, size, room);
    if (!chance(8))
        size = chance((uint32_t)size + 1u);
    for (uint32_t i = 0, more = 1u + chance(6); i < more; i++) {
        size_t count = write_act(act), at = 0;
        for (uint32_t skip = chance(24), took = 1; skip && took; skip--, at += took)
            took = (uint32_t)act_bytes(data + at, size - at);
        if (count > room - size)
            break;
        memmove(data + at + count, data + at, size - at);
        memcpy(data + at, act, count);
        size += count;
    }
    return size;
}
