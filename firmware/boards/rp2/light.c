/*
 * WS2812B by PIO and DMA.
 *
 * The state machine runs at 12 MHz, 15 cycles a bit: 0 = 4 high + 11 low (333 + 917 ns), 1 = 8 high + 7 low
 * (667 + 583 ns). The data sheets of WS2812B (400/850, 800/450 +-150 ns), WS2812B-V5 and WS2812B-2020 (220..380 /
 * 580..1000, 580..1000 / from 580 ns) all admit this.
 *
 *     bit:  out x, 1        side 0 [6]     0x6621
 *           jmp !x, zero    side 1 [3]     0x1323
 *           jmp bit         side 1 [3]     0x1300
 *     zero: nop             side 0 [3]     0xa342
 *
 * A light waits for its time in alarm 0, whose interrupt goes before all others and does nothing but start the DMA.
 */
#include "board.h"
#include "registers.h"
#include "ring.h"

#define PROGRAM_LENGTH 4u
#define CLOCK_DIVIDER 10u

enum phase {
    PHASE_IDLE,
    PHASE_TRIGGER,  /* waits for an edge */
    PHASE_TIME,     /* waits for alarm 0 */
    PHASE_SHIFTING, /* alarm 0 ends the latch time */
    PHASE_DONE,
};

static const uint16_t program[PROGRAM_LENGTH] = {0x6621, 0x1323, 0x1300, 0xa342};
static uint32_t words[MOST_LEDS]; /* the colours from the top, in the order of the wire */
static uint32_t leds, wire_us, data_pin;
static volatile uint32_t pulse_us; /* of the light on its way */
static volatile uint8_t phase;
static volatile uint64_t began_us;
static uint32_t shown_us; /* from the first bit until the LEDs have latched */
struct trigger *light_trigger;

static void pin_set_output(void)
{
    REGISTER(PIO0_SM0_PINCTRL) = 1u << 26 | data_pin << 5; /* SET: one pin */
    REGISTER(PIO0_SM0_INSTR) = 0xe081;                    /* set pindirs, 1 */
    REGISTER(PIO0_SM0_PINCTRL) = 1u << 29 | data_pin << 10; /* side-set: that pin */
}

void light_setup(const struct configuration *configuration)
{
    uint32_t bits = ring_bits(configuration->colour_order);
    leds = configuration->led_count;
    data_pin = configuration->data_pin;
    wire_us = ring_wire_us(configuration->led_count, configuration->colour_order);
    for (uint32_t i = 0; i < PROGRAM_LENGTH; i++)
        REGISTER(PIO0_INSTR_MEM(i)) = program[i];
    REGISTER(PIO0_SM0_CLKDIV) = CLOCK_DIVIDER << 16;
    REGISTER(PIO0_SM0_EXECCTRL) = (PROGRAM_LENGTH - 1u) << 12;          /* wrap */
    REGISTER(PIO0_SM0_SHIFTCTRL) = 1u << 17 | (bits & 31u) << 25 | 1u << 30; /* autopull (0: 32), left, joined FIFO */
    pin_set_output();
    REGISTER(PADS_BANK0(data_pin)) = PAD_OUTPUT;
    REGISTER(IO_BANK0_CTRL(data_pin)) = FUNCTION_PIO0;
    REGISTER(PIO0_CTRL) = 1u << 4 | 1u << 8; /* restart: the shift register counts as empty */
    SET_BITS(PIO0_CTRL) = 1u << 0;
}

static void prepare_transfer(void)
{
    REGISTER(DMA_READ_ADDR) = (uint32_t)words;
    REGISTER(DMA_WRITE_ADDR) = PIO0_TXF0;
    REGISTER(DMA_TRANS_COUNT) = leds;
    /* enabled, words, read address counts up, chained to itself (to none), paced by PIO0 TX0, no interrupt */
    REGISTER(DMA_AL1_CTRL) = 1u << 0 | 2u << 2 | 1u << 4 | DMA_CHAIN(0u) | DMA_PACED_BY(0u) | DMA_QUIET;
}

/* Interrupts are off or this is the highest of them. */
static void launch(void)
{
    REGISTER(DMA_MULTI_CHAN_TRIGGER) = 1u << 0;
    began_us = clock_micros();
    phase = PHASE_SHIFTING;
    REGISTER(TIMER_ALARM(0)) = (uint32_t)began_us + shown_us;
}

/* Forget the alarm, even if it fires at this moment: an interrupt that is pending would pass for the next alarm. */
static void alarm_cancel(void)
{
    REGISTER(TIMER_ARMED) = 1u << 0;
    REGISTER(TIMER_INTR) = 1u << 0;
    REGISTER(NVIC_ICPR) = 1u << IRQ_TIMER_0;
}

/* Wait for a time that may be so near that the timer is there before the alarm is set, which then waits for 71 min. */
static void launch_at(uint64_t start_us)
{
    if (start_us > clock_micros()) {
        phase = PHASE_TIME;
        REGISTER(TIMER_ALARM(0)) = (uint32_t)start_us;
        if (clock_micros() < start_us || !(REGISTER(TIMER_ARMED) & 1u))
            return;
        alarm_cancel();
    }
    launch();
}

void light_show(void *context, const uint8_t *wire, uint64_t start_us, uint16_t latch_us)
{
    (void)context;
    for (uint32_t i = 0; i < leds; i++, wire += 3)
        words[i] = (uint32_t)wire[0] << 24 | (uint32_t)wire[1] << 16 | (uint32_t)wire[2] << 8;
    shown_us = wire_us + latch_us + 1u;
    prepare_transfer();
    uint32_t interrupts = interrupts_off(); /* and a barrier to the compiler: the words are written before the DMA runs */
    if (start_us == PORT_ON_TRIGGER)
        phase = PHASE_TRIGGER;
    else
        launch_at(start_us);
    interrupts_restore(interrupts);
}

bool light_cancel(void *context)
{
    (void)context;
    uint32_t interrupts = interrupts_off();
    bool waiting = phase == PHASE_TIME || phase == PHASE_TRIGGER;
    if (waiting) {
        alarm_cancel();
        phase = PHASE_IDLE;
    }
    interrupts_restore(interrupts);
    return waiting;
}

/* All words have left the DMA and the FIFO. A transfer that breaks off has words left for ever: it is overdue soon. */
static bool transferred(void)
{
    return !(REGISTER(DMA_CTRL_TRIG) & DMA_BUSY) && !REGISTER(DMA_TRANS_COUNT) && REGISTER(PIO0_FSTAT) & 1u << 24;
}

enum port_light light_result(void *context, uint64_t *first_bit_us, uint64_t *latched_us)
{
    (void)context;
    if (phase == PHASE_IDLE)
        return PORT_LIGHT_NONE;
    if (phase != PHASE_DONE || !transferred())
        return PORT_LIGHT_WAITING;
    phase = PHASE_IDLE;
    *first_bit_us = began_us;
    *latched_us = began_us + shown_us;
    return PORT_LIGHT_LATCHED;
}

/* What waited for the light before has no meaning any more. */
static void finish(void)
{
    phase = PHASE_DONE;
    if (pulse_us != PORT_NO_PULSE)
        pins_pulse(pulse_us > shown_us ? pulse_us - shown_us : 0);
    else
        pins_pulse(PORT_NO_PULSE);
}

void light_pulse(void *context, uint32_t after_us)
{
    (void)context;
    pulse_us = after_us;
}

void light_interrupt(void)
{
    REGISTER(TIMER_INTR) = 1u << 0;
    if (phase == PHASE_TIME)
        launch();
    else if (phase == PHASE_SHIFTING)
        finish();
}

void trigger_interrupt(void)
{
    uint64_t now_us = clock_micros();
    pins_acknowledge();
    if (!trigger_edge(light_trigger, now_us))
        return;
    uint32_t interrupts = interrupts_off();
    if (phase == PHASE_TRIGGER)
        launch_at(light_trigger->start_us);
    interrupts_restore(interrupts);
}

/* The program and its settings are still what was loaded. */
bool light_path_intact(void)
{
    return REGISTER(PIO0_SM0_CLKDIV) == CLOCK_DIVIDER << 16 &&
           REGISTER(PIO0_SM0_PINCTRL) == (1u << 29 | data_pin << 10) && (REGISTER(IO_BANK0_CTRL(data_pin)) & FUNCTION_NONE) == FUNCTION_PIO0;
}

static void spin_us(uint32_t duration_us)
{
    uint32_t begin = REGISTER(TIMER_TIMERAWL);
    while (REGISTER(TIMER_TIMERAWL) - begin < duration_us)
        ;
}

/*
 * For the fault handler: no interrupts, no DMA, no state; a running transfer ends and the LEDs latch it first. A fault
 * before clock_start() has ended finds no light path and no timer to wait by: only the restart is left.
 */
void light_force_dark(void)
{
    if (~REGISTER(RESETS_DONE) & (RESET_DMA | RESET_PIO0 | RESET_TIMER))
        return;
    spin_us(wire_us + 500u);
    REGISTER(DMA_CHAN_ABORT) = 1u << 0; /* only now: or a transfer that runs would be torn */
    for (uint32_t i = 0; i < leds; i++) {
        while (REGISTER(PIO0_FSTAT) & 1u << 16)
            ;
        REGISTER(PIO0_TXF0) = 0;
    }
    spin_us(wire_us + 500u);
}
