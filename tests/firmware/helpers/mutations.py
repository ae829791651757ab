"""Firmware faults, one at a time: what to change in which file. Each has to be caught by a test."""

# ruff: noqa: E501 (a line of C stays one line)

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple


class Mutation(NamedTuple):
    """A fault of the firmware: in `file`, `old` becomes `new`."""

    name: str
    file: str
    old: str
    new: str
    check: str = "colours"
    """of `examination.py`, for a fault of the board: the one that notices"""


@contextmanager
def planted(mutation: Mutation, copied: Path) -> Iterator[Path]:
    """Plant a fault in a copy of the firmware, yield the copy, and take the fault out again.

    All faults share one copy: the compiler knows the files that did not change by their paths.
    """
    path = copied / mutation.file
    source = path.read_text()
    assert source.count(mutation.old) == 1, f"{mutation.name} does not apply any more"
    path.write_text(source.replace(mutation.old, mutation.new))
    try:
        yield copied
    finally:
        path.write_text(source)


BOARD, SHARED, CORE = "firmware/boards/rp2040", "firmware/boards/rp2", "firmware/core"

IMAGE = (
    Mutation("PIO left in reset", f"{SHARED}/clock.c", "RESET_PADS_BANK0 | RESET_PIO0", "RESET_PADS_BANK0"),
    Mutation("wrong divider", f"{SHARED}/light.c", "#define CLOCK_DIVIDER 10u", "#define CLOCK_DIVIDER 11u"),
    Mutation("pin not given to the PIO", f"{SHARED}/light.c", "(data_pin)) = FUNCTION_PIO0;", "(data_pin)) = FUNCTION_SIO;"),
    Mutation("pin is no output", f"{SHARED}/light.c", "REGISTER(PIO0_SM0_INSTR) = 0xe081;", ""),
    Mutation("wrong autopull", f"{SHARED}/light.c", "(bits & 31u) << 25", "(bits - bits) << 25"),
    Mutation("shift register not emptied", f"{SHARED}/light.c", "REGISTER(PIO0_CTRL) = 1u << 4 | 1u << 8;", ""),
    Mutation("one LED too few", f"{SHARED}/light.c", "REGISTER(DMA_TRANS_COUNT) = leds;",
             "REGISTER(DMA_TRANS_COUNT) = leds - 1u;"),
    Mutation("latch time cut short", f"{SHARED}/light.c", "shown_us = wire_us + latch_us + 1u;",
             "shown_us = latch_us - 100u;", "sequence"),
    Mutation("RGB on the wire", f"{CORE}/ring.c", "uint32_t red = order == COLOUR_ORDER_RGB ? 0 : 1;", "(void)order;\n    uint32_t red = 0;"),
    Mutation("stuck data toggle", f"{SHARED}/usb.c", "in_data1 = !in_data1;", ""),
    Mutation("no pull-up", f"{SHARED}/usb.c", "SET_BITS(USB_SIE_CTRL) = 1u << 16;", ""),
    Mutation("clk_usb off", f"{SHARED}/clock.c", "REGISTER(CLK_USB_CTRL) = 1u << 11;", ""),
    Mutation("PLL at 50.4 MHz", f"{SHARED}/clock.c", "RESET_PLL_USB, 100,", "RESET_PLL_USB, 105,"),
    Mutation("crystal of 1 ms", f"{SHARED}/clock.c", "#define CRYSTAL_DELAY 3000u", "#define CRYSTAL_DELAY 47u"),
    Mutation("slow oscillator of the PLL", f"{SHARED}/clock.c", "100, 5u << 16 | 5u << 12", "40, 5u << 16 | 2u << 12"),
    Mutation("post dividers in the wrong order", f"{SHARED}/clock.c", "6u << 16 | 2u << 12", "2u << 16 | 6u << 12"),
    Mutation("processor at 144 MHz", f"{SHARED}/clock.c", "6u << 16 | 2u << 12", "5u << 16 | 2u << 12"),
    Mutation("processor no faster than USB", f"{SHARED}/clock.c", "    REGISTER(CLK_SYS_CTRL) = 0;  ",
             "    REGISTER(CLK_SYS_CTRL) = 1u << 5;  "),
    Mutation("watchdog too short for the crystal", f"{SHARED}/watchdog.c", "#define START_US 200000u", "#define START_US 20000u", "start_fault"),
    Mutation("no fault vector at the start", f"{SHARED}/start.c", "    [3] = start_fault,\n", ""),
    Mutation("fault at the start hangs", f"{SHARED}/watchdog.c",
             "note_reason(RESET_REASON_FAULT);\n    SET_BITS(WATCHDOG_CTRL) = 1u << 31;", "note_reason(RESET_REASON_FAULT);", "start_fault"),
    Mutation("alarm not acknowledged", f"{SHARED}/light.c", "    REGISTER(TIMER_INTR) = 1u << 0;\n    if (phase == PHASE_TIME)",
             "    if (phase == PHASE_TIME)"),
    Mutation("light of lower priority than USB", f"{SHARED}/clock.c", "prioritize(IRQ_TIMER_0, 0x00u);", "prioritize(IRQ_TIMER_0, 0xc0u);", "sequence"),
    Mutation("watchdog never started", f"{SHARED}/start.c", "    watchdog_start();\n", ""),
    Mutation("watchdog fed without progress", f"{SHARED}/watchdog.c", "#define TIMEOUT_US 100000u", "#define TIMEOUT_US 8000000u", "watchdog"),
    Mutation("fault handler leaves the light", f"{SHARED}/watchdog.c", "    light_force_dark();\n    watchdog_restart(RESET_REASON_FAULT);",
             "    watchdog_restart(RESET_REASON_FAULT);", "fault"),
    Mutation("fault handler tears a transfer", f"{SHARED}/light.c", "    spin_us(wire_us + 500u);\n    REGISTER(DMA_CHAN_ABORT) = 1u << 0; /*", "    REGISTER(DMA_CHAN_ABORT) = 1u << 0; /*", "fault"),
    Mutation("suspend ignored", f"{SHARED}/usb.c", "close_port(USB_SUSPENDED);", "", "suspend"),
    Mutation("closed port ignored", f"{SHARED}/usb.c", "baud == BAUD_TOUCH ? USB_BOOTLOADER : USB_CLOSED",
             "baud == BAUD_TOUCH ? USB_BOOTLOADER : (enum usb_event)0", "close"),
    Mutation("reason of a start kept through the boot loader", f"{BOARD}/rom.c", "    watchdog_forget();\n", "", "reflash"),
    Mutation("every restart is the watchdog's", f"{SHARED}/watchdog.c", "(uint8_t)note : RESET_REASON_COMMAND;",
             "(uint8_t)note : RESET_REASON_WATCHDOG;", "reflash"),
    Mutation("IN armed near the end of a frame", f"{SHARED}/usb.c", "#define FRAME_ENDS_US 700u", "#define FRAME_ENDS_US 1000u", "short_packets"),
    Mutation("hung controller left alone", f"{SHARED}/usb.c", "if (!hung) {", "if (!hung || 1) {", "bus"),
    Mutation("a rest taken for a hang", f"{SHARED}/usb.c", "    progress_us = now_us(); /* nothing", "    /* nothing", "long_rest"),
    Mutation("packets that end no transfer", f"{SHARED}/usb.c", "#define IN_PACKET 48u", "#define IN_PACKET 64u", "short_packets"),
    Mutation("resume ignored", f"{SHARED}/usb.c", "static void resume(void)\n{\n    if (terminal_ready)", "static void resume(void)\n{\n    if (0)", "bus"),
    Mutation("halt of IN cleared, its toggle kept", f"{SHARED}/usb.c", "        in_data1 = false;\n        send_packet();", "        send_packet();", "bus"),
    Mutation("halt of OUT cleared, its toggle kept", f"{SHARED}/usb.c", "        out_data1 = false;\n        accept_packet();", "        out_data1 = !out_data1;\n        accept_packet();", "bus"),
    Mutation("halted endpoint that does not stall", f"{SHARED}/usb.c", "take_back(endpoint, STALL);", "take_back(endpoint, 0);", "bus"),
    Mutation("halt of IN forgotten", f"{SHARED}/usb.c", "if (in_waiting && !data_halted(BULK_IN))", "if (in_waiting)", "bus"),
    Mutation("packet of a halt lost", f"{SHARED}/usb.c", "        in_waiting = in_busy;\n", "        in_busy = in_count = 0;\n", "bus"),
    Mutation("halt not told", f"{SHARED}/usb_control.c", "of_endpoint && data_halted(setup.index);", "0;", "bus"),
    Mutation("asleep while bytes wait", f"{SHARED}/main.c", "        if (!more)\n", "        if (!more || 1)\n", "noise"),
    Mutation("a host that does not read taken for a hang", f"{SHARED}/usb.c", "dark ? PAUSED_US", "dark ? HUNG_US", "paused"),
    Mutation("answer of a transfer that was cut short", f"{SHARED}/usb_control.c", "    control_abort();\n    control_data1 = true;",
             "    control_data1 = true;", "bus"),
    Mutation("address of a transfer that was cut short", f"{SHARED}/usb_control.c",
             "    expect_line_coding = false;\n    new_address = NO_ADDRESS;\n", "    expect_line_coding = false;\n", "bus"),
    Mutation("break refused", f"{SHARED}/usb_control.c", "control_accept(); /* nobody listens to it */", "control_refuse();", "bus"),
    Mutation("output never pulses", f"{SHARED}/pins.c", "    REGISTER(SIO_OUT_SET) = output;\n", "", "wiring"),
    Mutation("pulse never ends", f"{SHARED}/pins.c", "    if (due && pulsing)\n        REGISTER(SIO_OUT_CLEAR) = output;", "    if (due && pulsing)\n        pulsing = true;", "wiring"),
    Mutation("pulse in the middle forgotten", f"{SHARED}/light.c", "pins_pulse(pulse_us > shown_us ? pulse_us - shown_us : 0);", "pins_pulse(0);", "wiring"),
    Mutation("pulse in the dark", f"{CORE}/lights.c", "slot->shines ? 0 : PORT_NO_PULSE;", "0;", "wiring"),
    Mutation("status LED does not blink", f"{SHARED}/main.c", "            status_show(&controller);\n", "", "wiring"),
    Mutation("status LED steady without a host", f"{SHARED}/pins.c", "controller->open && !failed", "!failed", "wiring"),
    Mutation("faults not shown", f"{SHARED}/pins.c", "failed(controller) ? FAST_US : SLOW_US", "SLOW_US", "wiring"),
    Mutation("status LED upside down", f"{SHARED}/pins.c", "on != status_low ?", "on ?", "wiring"),
    Mutation("trigger stays at its pin", f"{SHARED}/pins.c", "trigger_pin = configuration->trigger_pin;", "trigger_pin = 3;", "wiring"),
    Mutation("data stays at its pin", f"{SHARED}/light.c", "data_pin = configuration->data_pin;", "data_pin = 2;", "wiring"),
    Mutation("always 24 bits an LED", f"{CORE}/ring.c", "order == COLOUR_ORDER_RGBW ? 32 : 24", "(void)order, 24", "wiring"),
    Mutation("trigger delay forgotten", f"{CORE}/trigger.c", "now_us + trigger->delay_us", "now_us", "trigger"),
    Mutation("flash changed with interrupts on", f"{SHARED}/flash.c", "access.interrupts = interrupts_off();",
             "access.interrupts = 0;", "hub"),
    Mutation("configuration in another place", f"{SHARED}/flash.c", "run(CONFIG_OFFSET + offset, page", "run(offset, page", "hub"),
    Mutation("wrong unique number", f"{BOARD}/rom.c", "dummy < 4", "dummy < 3"),
    Mutation("closing forgotten when opened again", f"{SHARED}/usb.c", "events = (uint8_t)(events | what);", "events = (uint8_t)what;", "close"),
    Mutation("a USB frame of long ago noted", f"{SHARED}/usb.c", "    (void)REGISTER(USB_SOF_RD);\n    SET_BITS", "    SET_BITS", "long_rest"),
    Mutation("packets taken without room", f"{SHARED}/usb.c", "RING_BYTES - ring_count(&incoming) >= PACKET", "true", "flood"),
    Mutation("a busy bus not joined", f"{SHARED}/usb.c", "    join_begin();\n", "", "hub"),
    Mutation("idle forced while the host resets", f"{BOARD}/usb_join.c", "state == JOIN_RESET && bus & LINE_STATE", "state == JOIN_RESET", "hub"),
    Mutation("idle forced too briefly", f"{BOARD}/usb_join.c", "        looks = MOST_RESET_LOOKS - MOST_FORCED_LOOKS;\n    }\n    look_later();", "        REGISTER(TIMER_ALARM(3)) = REGISTER(TIMER_TIMERAWL) + 500u;\n        looks = MOST_RESET_LOOKS;\n        return;\n    }\n    look_later();", "hub"),
    Mutation("pull-up falls while idle is forced", f"{BOARD}/usb_join.c", "    SET_BITS(USB_PHY_OVERRIDE) = PULL_UP_OVERRIDE;\n", "", "hub"),
    Mutation("lines left at the pads", f"{BOARD}/usb_join.c", "    REGISTER(USB_MUXING) = TO_PHY;\n", "", "hub"),
    Mutation("GPIO15 kept", f"{BOARD}/usb_join.c", "    REGISTER(IO_BANK0_CTRL(DATA_PLUS)) = function;\n", "", "hub"),
    Mutation("GPIO15 taken where it is in use", f"{BOARD}/usb_join.c", "(REGISTER(IO_BANK0_CTRL(DATA_PLUS)) & FUNCTION_NONE) != FUNCTION_NONE", "0", "hub"),
    Mutation("GPIO15 taken on silicon that needs it not", f"{BOARD}/usb_join.c", "REGISTER(SYSINFO_CHIP_ID) >> 28 != B0_OR_B1", "0", "hub"),
    Mutation("load switch upside down", f"{SHARED}/pins.c", "closed != switch_low ?", "closed ?", "wiring"),
    Mutation("load switch not driven", f"{SHARED}/pins.c", "    load_switch = prepare_switch(configuration->switch_pin, &switch_low);\n", "", "wiring"),
    Mutation("load switch closed through a fault", f"{SHARED}/watchdog.c", "    pins_power(NULL, false);\n", "", "wiring"),
    Mutation("temperature of another sensor", f"{SHARED}/thermometers.c", "#define CHIP_CHANNEL 4u", "#define CHIP_CHANNEL 3u", "heat"),
    Mutation("the hotter the colder", f"{SHARED}/thermometers.c", "(4372 - (int32_t)", "((int32_t)", "heat"),
    Mutation("an NTC that is not there is not noticed", f"{SHARED}/thermometers.c", "PAD_ANALOG_PULLED_UP : PAD_ANALOG;", "PAD_ANALOG : PAD_ANALOG;", "heat"),
    Mutation("the NTC is read against the pull-up", f"{SHARED}/thermometers.c", "if (!pulled || now >= THERMISTOR_OPEN)\n", "if (pulled || now >= THERMISTOR_OPEN)\n", "heat"),
    Mutation("the input of the NTC stays a digital one", f"{SHARED}/common_registers.h", "#define PAD_ANALOG 0x80u", "#define PAD_ANALOG 0x40u", "heat"),
    Mutation("the NTC at another input", f"{SHARED}/thermometers.c", "convert(THERMISTOR_PIN - FIRST_INPUT)", "convert(THERMISTOR_PIN + 1u - FIRST_INPUT)", "heat"),
    Mutation("the pin of the NTC taken from what uses it", f"{SHARED}/thermometers.c", "!FITTED || (REGISTER(IO_BANK0_CTRL(THERMISTOR_PIN)) & FUNCTION_NONE) != FUNCTION_NONE", "!FITTED", "wiring"),
)  # fmt: skip

# What has to be on, or to be done in order, at the boot, the flash and USB: an emulator is easily blind for it.
ENABLES = (
    Mutation("boot2: flash read too fast", f"{BOARD}/boot2.S", "    movs r0, #4\n    str r0, [r3, #0x14]", "    movs r0, #2\n    str r0, [r3, #0x14]"),
    Mutation("boot2: no clock for the flash", f"{BOARD}/boot2.S", "    movs r0, #4\n    str r0, [r3, #0x14]", "    movs r0, #0\n    str r0, [r3, #0x14]"),
    Mutation("boot2: another command", f"{BOARD}/boot2.S", "=0x03000218", "=0x13000218"),
    Mutation("boot2: addresses of 16 bits", f"{BOARD}/boot2.S", "=0x03000218", "=0x03000210"),
    Mutation("boot2: frames of 16 bits", f"{BOARD}/boot2.S", "=0x001f0300", "=0x000f0300"),
    Mutation("boot2: nothing comes back", f"{BOARD}/boot2.S", "=0x001f0300", "=0x001f0100"),
    Mutation("boot2: SSI left off", f"{BOARD}/boot2.S", "    movs r0, #1\n    str r0, [r3, #0x08]", "    movs r0, #0\n    str r0, [r3, #0x08]"),
    Mutation("XIP not left", f"{SHARED}/flash.c", "    access.leave_xip();\n", ""),
    Mutation("flash not connected", f"{SHARED}/flash.c", "    access.connect();\n", ""),
    Mutation("XIP not entered again", f"{SHARED}/flash.c", "    access->enter_xip();\n", "", "configuration"),
    Mutation("cache not flushed", f"{SHARED}/flash.c", "    access->flush();\n", "", "configuration"),
    Mutation("watchdog not paused for an erase", f"{SHARED}/flash.c", "    watchdog_pause();\n", "", "configuration"),
    Mutation("stall of endpoint 0 not armed", f"{SHARED}/usb_control.c", "    REGISTER(USB_EP_STALL_ARM) = 3; /* endpoint 0, IN and OUT */\n", "", "refusals"),
    Mutation("AVAILABLE in one write", f"{SHARED}/usb_wire.h", "    REGISTER(control) = value;\n    __asm volatile(\"nop\\n nop\\n nop\\n nop\\n nop\\n nop\\n nop\\n nop\\n nop\\n nop\\n nop\\n nop\");\n", ""),
    Mutation("VBUS not forced", f"{SHARED}/usb.c", "    REGISTER(USB_PWR) = 1u << 2 | 1u << 3;     /* VBUS is taken to be there */\n", ""),
    Mutation("USB not connected to its PHY", f"{SHARED}/usb.c", "    REGISTER(USB_MUXING) = TO_PHY;\n", ""),
    Mutation("clk_adc off", f"{SHARED}/clock.c", "    REGISTER(CLK_ADC_CTRL) = 1u << 11;\n", ""),
    Mutation("outputs switched off at their pads", f"{SHARED}/common_registers.h", "#define PAD_OUTPUT 0x52u", "#define PAD_OUTPUT 0xd2u"),
    Mutation("inputs switched off at their pads", f"{SHARED}/common_registers.h", "#define PAD_PULLED_UP 0x4au", "#define PAD_PULLED_UP 0x0au", "trigger"),
    Mutation("endpoints off", f"{SHARED}/usb.c", "#define ENABLED (1u << 31 | 1u << 29)", "#define ENABLED (1u << 29)"),
    Mutation("bulk endpoints of the type control", f"{SHARED}/usb.c", "#define BULK (2u << 26)", "#define BULK (0u << 26)"),
    Mutation("DMA not paced", f"{SHARED}/light.c", "DMA_PACED_BY(0u)", "DMA_PACED_BY(0x3fu)"),
    Mutation("endpoint 0 without interrupts", f"{SHARED}/usb.c", "    REGISTER(USB_SIE_CTRL) = 1u << 29;         /* interrupt for each buffer of endpoint 0 */\n", ""),
)  # fmt: skip

LOGIC = (
    Mutation("no blank on timeout", f"{CORE}/watches.c", "    lights_darken(controller, DARK_HOST_SILENT);", ""),
    Mutation("limit off", f"{CORE}/ring.c", "(limit_ua - quiescent_ua(limits)) * 255u", "4000000000u"),
    Mutation("repeats executed", f"{CORE}/controller.c", "request->sequence == kept->sequence", "false"),
    Mutation("hello from the cache", f"{CORE}/controller.c", "request->type != COMMAND_HELLO && ", ""),
    Mutation("checksum not compared", f"{CORE}/packet.c", "return PACKET_BAD_CRC;", ""),
    Mutation("schedule drifts", f"{CORE}/sequencer.c", "sequencer->fraction = (uint32_t)sum;", "sequencer->fraction = 0;"),
    Mutation("blank not waited for", f"{CORE}/sequencer.c", "advance(sequencer, step->blank_us);", ""),
    Mutation("one repetition too few", f"{CORE}/sequencer.c", "++next->repetition < ", "++next->repetition + 1 < "),
    Mutation("newest record not the one that counts", f"{CORE}/config.c", "record.saves <= config->saves",
             "(config->saves && record.saves >= config->saves)"),
    Mutation("newest sector erased", f"{CORE}/config.c", "page % SECTOR_PAGES == 0)\n        return port", "true)\n        return port"),
    Mutation("group number unchecked", f"{CORE}/light_commands.c", "outside(call, request->group, 0, GROUP_COUNT - 1))\n        return",
             "outside(call, request->group, 0, 255))\n        return"),
    Mutation("trigger timeout forgotten", f"{CORE}/watches.c", "if (!controller->sync.timeout_us || ", "if (1 || "),
    Mutation("clock read before the last edge", f"{CORE}/watches.c",
             "    uint32_t last_us = trigger->last_us; /* before the clock: an edge between the two would be later than now */\n    if ((uint32_t)controller_now_us(controller) - last_us",
             "    if ((uint32_t)controller_now_us(controller) - trigger->last_us"),
    Mutation("colours for LEDs that are not there", f"{CORE}/commands.c", "(colours ? COLOUR_BYTES - 3u * controller->limits.led_count : 0u)", "(colours ? COLOUR_BYTES - 3u * (controller->limits.led_count ? LED_COUNT : 0u) : 0u)"),
    Mutation("current of the LEDs behind the twelfth forgotten", f"{CORE}/ring.c", "i < 3u * limits->led_count; i++)\n        total", "i < (limits->led_count ? 36u : 0u); i++)\n        total"),
    Mutation("one pin for two", f"{CORE}/config.c", "(pins[i] != NO_PIN && used >> pins[i] & 1u)", "0"),
    Mutation("pins of an older record taken as they are", f"{CORE}/config.c", "    if (configuration->led_count != 0xff)\n        return;", "    if (1)\n        return;"),
    Mutation("number of LEDs changed while it runs", f"{CORE}/ring.c", "    limits->hottest_c = configuration->hottest_c;", "    limits->hottest_c = configuration->hottest_c;\n    limits->led_count = configuration->led_count;"),
    Mutation("no room kept for a reply", f"{CORE}/events.c", "wire, size, PACKET_WIRE_BYTES))", "wire, size, 0))"),
    Mutation("any current of an LED on USB", f"{CORE}/config.c", "candidate->external_supply ? CHANNEL_EXTERNAL_UA : CHANNEL_USB_UA", "CHANNEL_EXTERNAL_UA"),
    Mutation("a supply of its own without confirmation", f"{CORE}/config.c", "within(candidate->external_supply, 0, now->external_supply, value)", "true"),
    Mutation("a supply of its own at once", f"{CORE}/commands.c", "    ring_bound(&controller->limits, &controller->granted);\n", ""),
    Mutation("any number confirms a supply", f"{CORE}/commands.c", "request->magic != SUPPLY_MAGIC", "!request->magic"),
    Mutation("as many saves as a host wants", f"{CORE}/commands.c", "if (ahead_us > SAVES_AHEAD_US)", "if (ahead_us > 4000000000u)"),
    Mutation("a housing of any heat", f"{CORE}/heat.c", "much && heat->charge > HOUSING_CHARGE;", "much && heat->charge > 8u * HOUSING_CHARGE;"),
    Mutation("what was drawn is never forgotten", f"{CORE}/heat.c", "heat->drawn - (heat->charge >> HOUSING_READINGS)", "heat->drawn"),
    Mutation("every edge counts", f"{CORE}/trigger.c", "if (++trigger->edges < trigger->divider)", "if (++trigger->edges < 1)"),
    Mutation("commit at once", f"{CORE}/sequencer.c", "    if (sequencer->running)\n        sequencer->swap = true;\n    else\n        take_over",
             "    take_over"),
    Mutation("staged later, committed all the same", f"{CORE}/sequencer.c", "&sequencer->pending, sizeof sequencer->active",
             "&sequencer->staged, sizeof sequencer->active"),
    Mutation("light of a stopped sequence counts for the next", f"{CORE}/lights.c", "    controller->slot.role = SEQUENCER_NONE; /*", "    /*"),
    Mutation("closed port still heard", f"{CORE}/controller.c", "if (!controller->open) /*", "if (0) /*"),
    Mutation("watchdog fed while no light gets through", f"{CORE}/controller.c", " start_us + OVERDUE_US;", " start_us + 1000u * OVERDUE_US;"),
    Mutation("late passes for overdue", f"{CORE}/lights.c", "if (slot->start_us < now_us) /*", "if (!slot->start_us) /*"),
    Mutation("shift to before time began", f"{CORE}/sequencer.c", "(uint64_t)-phase_us > sequencer->due_us", "0"),
    Mutation("heat ignored", f"{CORE}/heat.c", "heat->mean > degrees(hottest_c)", "heat->mean > degrees(hottest_c + 100)"),
    Mutation("heat of the ring ignored", f"{CORE}/heat.c", "degrees((int32_t)RING_HOTTEST_C)", "degrees((int32_t)RING_HOTTEST_C + 100)"),
    Mutation("no hysteresis of the ring", f"{CORE}/heat.c", "(int32_t)(RING_HOTTEST_C - COOLER_C)", "(int32_t)RING_HOTTEST_C"),
    Mutation("an NTC that is lost passes for cool", f"{CORE}/heat.c", ": !heat->ring_felt;", ": true;"),
    Mutation("an open NTC passes for cold", f"{CORE}/thermistor.c", " || reading >= THERMISTOR_OPEN)", " || reading >= 4096u)"),
    Mutation("a short NTC passes for hot", f"{CORE}/thermistor.c", "reading <= THERMISTOR_SHORT ||", "!reading ||"),
    Mutation("the NTC by half of its beta", f"{CORE}/thermistor.c", "#define BETA_K 3380", "#define BETA_K 1690"),
    Mutation("logarithm without its fraction", f"{CORE}/thermistor.c", "            log += (int32_t)bit;\n", ""),
    Mutation("never cool again", f"{CORE}/heat.c", "!(cool && heat->dimmed)", "!(cool && !heat->dimmed)"),
    Mutation("no hysteresis", f"{CORE}/heat.c", "(int32_t)hottest_c - (int32_t)COOLER_C", "(int32_t)hottest_c"),
    Mutation("dims at every reading", f"{CORE}/heat.c", "now_us - heat->dimmed_us < DIMMING_US", "now_us - heat->dimmed_us < 1u"),
    Mutation("one reading counts", f"{CORE}/heat.c", "temperature - *mean / READINGS;", "temperature * READINGS - *mean;"),
    Mutation("limit of heat not that of the configuration", f"{CORE}/watches.c", "controller->limits.hottest_c))", "HOTTEST_C))"),
    Mutation("dimmed without a word", f"{CORE}/watches.c", "        event_dimmed(controller);\n", "        controller->event_sequence++;\n"),
    Mutation("a light that stays is not dimmed", f"{CORE}/watches.c", "    show_again(controller);\n", "    (void)show_again;\n"),
    Mutation("a light that waits for the trigger keeps the last one bright", f"{CORE}/watches.c", "(!trigger->armed || !trigger_disarm(trigger))", "(trigger || !trigger_disarm(trigger))"),
    Mutation("steps not dimmed", f"{CORE}/lights.c", "    ring_dim(slot->dimmed, dimmed);\n", ""),
    Mutation("scale of the reply knows no heat", f"{CORE}/light_commands.c", "(uint16_t)(FULL_SCALE >> halvings)", "FULL_SCALE"),
    Mutation("dimmed to nothing", f"{CORE}/ring.c", "(colours[i] + (1u << halvings) - 1u) >> halvings", "colours[i] >> halvings"),
    Mutation("any limit of heat", f"{CORE}/config.c", "within(candidate->hottest_c, 40, 85, value)", "within(candidate->hottest_c, 0, 255, value)"),
    Mutation("limit of heat of an older record taken as it is", f"{CORE}/config.c", "if (configuration->hottest_c == 0xff)", "if (0)"),
    Mutation("light before the supply has risen", f"{CORE}/lights.c", "if (slot->start_us < controller->supply.settled_us)", "if (0)"),
    Mutation("sequence late for the supply", f"{CORE}/light_commands.c", "controller->supply.settled_us > now_us ?", "now_us > controller->supply.settled_us ?"),
    Mutation("triggered before the supply has risen", f"{CORE}/lights.c", "if (sequencer->mode == SYNC_MODE_EXT && ", "if (0 && "),
    Mutation("load switch never opened", f"{CORE}/supply.c", "    port->power(port->context, false);\n", "    (void)port;\n"),
    Mutation("load switch opened before the dark", f"{CORE}/controller.c", "if (!controller->slot.busy && !lights_will_shine(controller))", "if (!lights_will_shine(controller))"),
    Mutation("waits for a load switch that is not there", f"{CORE}/supply.c", "if (!supply->fitted || supply->closed)", "if (supply->closed)"),
)  # fmt: skip
