#include "board.h"

#include "bytes.h"

/* Of the process that loads the library, which is built without the headers of any C library. */
void *calloc(size_t count, size_t size);
void free(void *memory);
void abort(void);

#define TICK_US 10000u

static void edge(struct board *board, bool falling);

/* An interrupt may come after any reading of the clock; time has gone on by then. */
static uint64_t port_micros(void *context)
{
    struct board *board = context;
    uint64_t read_us = board->now_us;
    if (board->reads_to_edge && !--board->reads_to_edge) {
        board->now_us++;
        edge(board, false);
    }
    return read_us;
}

static void port_setup(void *context, const struct configuration *configuration)
{
    struct board *board = context;
    board->wire_us = ring_wire_us(configuration->led_count, configuration->colour_order);
}

static void port_pulse(void *context, uint32_t after_us)
{
    struct board *board = context;
    board->light.pulse_us = after_us;
}

static bool port_send(void *context, const uint8_t *bytes, size_t count, size_t spare)
{
    struct board *board = context;
    if (count + spare > board->room || count > BOARD_OUTPUT_BYTES - board->output_count)
        return false;
    board->room -= board->room < BOARD_OUTPUT_BYTES ? (uint32_t)count : 0;
    bytes_copy(board->output + board->output_count, bytes, count);
    board->output_count += (uint32_t)count;
    return true;
}

static void begin(struct board *board, uint64_t start_us)
{
    board->on_trigger = false;
    board->light.first_bit_us = start_us > board->now_us ? start_us : board->now_us;
    board->light.latched_us = board->light.first_bit_us + board->wire_us + board->latch_us;
}

static void port_light(void *context, const uint8_t *wire, uint64_t start_us, uint16_t latch_us)
{
    struct board *board = context;
    if (board->waiting)
        abort(); /* the core broke its contract */
    bytes_copy(board->light.wire, wire, COLOUR_BYTES);
    board->latch_us = latch_us;
    board->waiting = true;
    board->on_trigger = start_us == PORT_ON_TRIGGER;
    if (!board->on_trigger)
        begin(board, start_us);
}

static bool port_light_cancel(void *context)
{
    struct board *board = context;
    if (!board->waiting || (!board->on_trigger && board->light.first_bit_us <= board->now_us))
        return false;
    board->waiting = false;
    return true;
}

static enum port_light port_light_result(void *context, uint64_t *first_bit_us, uint64_t *latched_us)
{
    struct board *board = context;
    if (!board->waiting)
        return PORT_LIGHT_NONE;
    if (board->on_trigger || board->now_us < board->light.latched_us || board->stuck)
        return PORT_LIGHT_WAITING;
    board->waiting = false;
    *first_bit_us = board->light.first_bit_us;
    *latched_us = board->light.latched_us;
    board->lights[board->light_count++ % BOARD_LIGHTS] = board->light;
    return PORT_LIGHT_LATCHED;
}

static void port_trigger(void *context, bool enabled, bool falling)
{
    struct board *board = context;
    board->listening = enabled;
    board->falling = falling;
}

static void port_power(void *context, bool closed)
{
    struct board *board = context;
    board->powered = closed;
}

static int16_t port_temperature(void *context)
{
    const struct board *board = context;
    return board->temperature;
}

static uint16_t port_thermistor(void *context)
{
    const struct board *board = context;
    return board->thermistor;
}

static void port_flash_read(void *context, uint32_t offset, void *to, size_t count)
{
    struct board *board = context;
    if (offset > BOARD_FLASH_BYTES || count > BOARD_FLASH_BYTES - offset)
        abort();
    bytes_copy(to, board->flash + offset, count);
}

static bool powered(struct board *board)
{
    if (board->cut_after == 0)
        board->powerless = true;
    if (board->cut_after > 0)
        board->cut_after--;
    return !board->powerless;
}

static bool port_flash_erase(void *context, uint32_t sector)
{
    struct board *board = context;
    if (sector >= PORT_SECTORS)
        abort();
    for (uint32_t i = 0; i < PORT_SECTOR_BYTES && powered(board); i++)
        board->flash[sector * PORT_SECTOR_BYTES + i] = 0xff;
    return !board->powerless;
}

static bool port_flash_program(void *context, uint32_t offset, const uint8_t *page)
{
    struct board *board = context;
    if (offset % PORT_PAGE_BYTES || offset >= BOARD_FLASH_BYTES)
        abort();
    for (uint32_t i = 0; i < PORT_PAGE_BYTES && powered(board); i++)
        board->flash[offset + i] &= page[i];
    return !board->powerless;
}

static void port_note_saves(void *context, uint8_t saves)
{
    struct board *board = context;
    board->port.identity.saves = saves;
}

static uint16_t port_selftest(void *context, uint16_t *tested, uint32_t *stack_free)
{
    (void)context;
    *tested = CHECK_STORE;
    *stack_free = 0;
    return 0;
}

static void port_restart(void *context, bool bootloader)
{
    struct board *board = context;
    board->restarted = true;
    board->bootloader = bootloader;
}

static const struct port functions = {
    .micros = port_micros,
    .setup = port_setup,
    .pulse = port_pulse,
    .send = port_send,
    .light = port_light,
    .light_cancel = port_light_cancel,
    .light_result = port_light_result,
    .power = port_power,
    .trigger = port_trigger,
    .temperature = port_temperature,
    .thermistor = port_thermistor,
    .flash_read = port_flash_read,
    .flash_erase = port_flash_erase,
    .flash_program = port_flash_program,
    .note_saves = port_note_saves,
    .selftest = port_selftest,
    .restart = port_restart,
    .identity = {
        .board = BOARD_KIND_HOST,
        .unique_id = "virtual",
        .capabilities = CAPABILITY_TRIGGER | CAPABILITY_FLASH | CAPABILITY_TEMPERATURE,
    },
};

struct board *board_new(const uint8_t *flash, uint32_t saves)
{
    struct board *board = calloc(1, sizeof *board);
    if (!board)
        abort();
    bytes_fill(board->flash, 0xff, BOARD_FLASH_BYTES);
    if (flash)
        bytes_copy(board->flash, flash, BOARD_FLASH_BYTES);
    board->cut_after = -1;
    board->room = BOARD_OUTPUT_BYTES;
    board->temperature = 270;
    board->thermistor = THERMISTOR_OPEN;
    board->port = functions;
    board->port.context = board;
    board->port.identity.saves = (uint8_t)saves;
    controller_start(&board->controller, &board->port);
    return board;
}

void board_free(struct board *board)
{
    free(board);
}

void board_identify(struct board *board, const uint8_t *unique_id)
{
    bytes_copy(board->port.identity.unique_id, unique_id, sizeof board->port.identity.unique_id);
}

void board_receive(struct board *board, const uint8_t *bytes, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        controller_receive(&board->controller, bytes[i]);
    controller_poll(&board->controller);
}

/* The next instant at which the core may have something to do. */
static uint64_t next_event(const struct board *board, uint64_t end_us)
{
    uint64_t next = end_us;
    if (board->tick_us + TICK_US < next)
        next = board->tick_us + TICK_US;
    if (board->waiting && !board->on_trigger && !board->stuck && board->light.latched_us < next)
        next = board->light.latched_us;
    return next > board->now_us ? next : board->now_us;
}

void board_advance(struct board *board, uint64_t duration_us)
{
    uint64_t end_us = board->now_us + duration_us;
    do {
        board->now_us = next_event(board, end_us);
        if (board->now_us >= board->tick_us + TICK_US)
            board->tick_us = board->now_us;
        controller_poll(&board->controller);
    } while (board->now_us < end_us);
}

static void edge(struct board *board, bool falling)
{
    struct trigger *trigger = &board->controller.trigger;
    if (board->listening && falling == board->falling && trigger_edge(trigger, board->now_us) && board->waiting)
        begin(board, trigger->start_us);
}

void board_edge_after_reads(struct board *board, uint32_t reads)
{
    board->reads_to_edge = reads;
}

void board_edge(struct board *board, bool falling)
{
    edge(board, falling);
    controller_poll(&board->controller);
}

void board_link(struct board *board, bool open, uint32_t reason)
{
    controller_link(&board->controller, open, (enum dark)reason);
    controller_poll(&board->controller);
}

uint32_t board_take_output(struct board *board, uint8_t *bytes, uint32_t room)
{
    uint32_t count = board->output_count < room ? board->output_count : room;
    bytes_copy(bytes, board->output, count);
    bytes_copy(board->output, board->output + count, board->output_count - count);
    board->output_count -= count;
    return count;
}

uint32_t board_light_count(const struct board *board)
{
    return board->light_count;
}

void board_light_at(const struct board *board, uint32_t index, struct board_light *light)
{
    *light = board->lights[index % BOARD_LIGHTS];
}

void board_flash(const struct board *board, uint8_t *flash)
{
    bytes_copy(flash, board->flash, BOARD_FLASH_BYTES);
}

void board_fault(struct board *board, uint32_t room, bool stuck, int32_t cut_after)
{
    board->room = room;
    board->stuck = stuck;
    board->cut_after = cut_after;
}

void board_warm(struct board *board, int32_t temperature)
{
    board->temperature = (int16_t)temperature;
}

void board_warm_ring(struct board *board, uint32_t reading)
{
    board->thermistor = (uint16_t)reading;
}

bool board_powered(const struct board *board)
{
    return board->powered;
}

uint32_t board_noted_saves(const struct board *board)
{
    return board->port.identity.saves;
}

uint64_t board_now(const struct board *board)
{
    return board->now_us;
}

uint64_t board_next(const struct board *board)
{
    return next_event(board, UINT64_MAX);
}

uint32_t board_flags(const struct board *board)
{
    return (controller_healthy(&board->controller) ? 1u : 0u) | (board->restarted ? 2u : 0u) |
           (board->bootloader ? 4u : 0u);
}

uint32_t board_current_ua(const struct board *board)
{
    const uint8_t *wire = board->lights[(board->light_count - 1u) % BOARD_LIGHTS].wire;
    return board->light_count ? ring_current_ua(&board->controller.limits, wire) : 0;
}
