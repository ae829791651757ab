"""Checks of a firmware image on a board: its life on the bus, and a ring that is wired otherwise."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gellight.ring import protocol as p
from gellight.ring.enumerations import ColourOrder, OutputAt, SyncMode
from gellight.ring.light_ring import LightRing, Step
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator.analog import OUTPUT_OFF, THERMISTOR_PIN
from tests.firmware.emulator.chip import VTOR
from tests.firmware.emulator.usb_host import ADDRESS
from tests.firmware.emulator.waveform import Strip
from tests.helpers import usb_requests as usb
from tests.helpers.bench_board import BenchBoard, VirtualTransport

PATTERN = np.arange(36, dtype=np.uint8).reshape(12, 3) * 7 % 97


def dark(board: BenchBoard) -> bool:
    board.run(8_000)
    return not board.lit.any()


def reopen(board: BenchBoard) -> LightRing:
    board.run_until(lambda: board.host.configured, 200_000)
    return LightRing(VirtualTransport(board), keep_alive_s=None, timeout_s=0.03, attempts=2)


def break_down(board: BenchBoard) -> None:
    """Enter what the vector of HardFault points to."""
    board.chip.core.pc = board.chip.read_uint32(board.chip.read_uint32(VTOR) + 12) & ~1
    board.chip.core.waiting = False


def bus(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    board.suspend()
    board.run(5_000)
    board.resume()
    ring.clock()
    device = board.host.descriptors["device"]
    for abandoned in (usb.GET_CONFIGURATION, usb.SET_ADDRESS, usb.GET_INTERFACE, usb.SEND_BREAK):
        if usb.ask_after_abandoning(board, abandoned, usb.GET_DEVICE) != device:
            yield "a transfer that was cut short answers the next"
    if board.chip.read_uint32(usb.ADDRESS_REGISTER) != ADDRESS:
        yield "the address of a transfer that was cut short"
    if usb.ask(board, usb.status_of(usb.NOTIFY_IN)) != b"\0\0":
        yield "the endpoint of notifications is not known"
    if usb.ask(board, usb.GET_LINE_CODING) != usb.LINE_CODING:
        yield "the line coding is another than the host has set"
    yield from _halt(board, ring)
    yield from _halted_for_long(board, ring)
    for request in (*[usb.CLEAR_HALT_IN] * 2, *[usb.CLEAR_HALT_OUT] * 2, usb.SET_INTERFACE, usb.SEND_BREAK):
        ring.clock()  # one packet between two of a kind
        if usb.ask(board, request) != b"":
            yield f"request {request} refused"
    board.host.reset_bus()
    board.run(5_000)
    ring = reopen(board)
    ring.set_leds(PATTERN)
    board.run(30_000)
    board.host.hangs = True
    if not board.run_until(lambda: not board.host.configured, 11_500_000) or not dark(board):
        yield "a controller that hangs is not reset in the dark"


def _halt(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """A packet that waits while its endpoint is halted comes after the halt."""
    board.host.latency_us = 10_000.0
    board.host.send(encode(Packet(p.COMMANDS["CLOCK"].code, 99, bytes(8))))
    board.run(3_000)
    board.host.latency_us = 0.0
    usb.ask(board, usb.halt(usb.BULK_IN))
    board.run(60_000)  # frames are noted meanwhile
    board.host.received.clear()
    if usb.BULK_IN not in board.host.stalled or usb.ask(board, usb.status_of(usb.BULK_IN)) != b"\1\0":
        yield "an endpoint that is halted does not stall"
    usb.ask(board, usb.clear_halt(usb.BULK_IN))
    board.run(3_000)
    if board.host.received.count(0) != 1:
        yield "a packet lost, or doubled, by a halt"


def _halted_for_long(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """A halt is no hang, and ends where a configuration is chosen (USB 2.0, 9.4.5)."""
    before = ring.configuration()
    ring.configure(replace(before, host_timeout_ms=5_000))
    ring.set_leds(PATTERN)
    usb.ask(board, usb.halt(usb.BULK_IN))
    board.host.send(encode(Packet(p.COMMANDS["CLOCK"].code, 99, bytes(8))))
    board.run(1_300_000)
    if not board.host.opened:
        yield "a controller whose host halted an endpoint is reset as one that hangs"
    usb.ask(board, usb.SET_CONFIGURATION)
    if usb.ask(board, usb.status_of(usb.BULK_IN)) != b"\0\0":
        yield "a halt outlives the choice of a configuration"
    board.host.open()
    board.run(5_000)
    ring.configure(before)


def refusals(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    if usb.ask(board, (0x80, 6, 0x0600, 0, 10)) is not None:  # a qualifier, which a device without high speed refuses
        yield "a descriptor that is not there is given"
    if usb.ask(board, (0x21, 0x02, 1, 0, 2), b"\0\0") is not None:  # SET_COMM_FEATURE, which the board does not have
        yield "a request that is not known takes data"
    if usb.ask(board, usb.SET_OTHER_SETTING) is not None:
        yield "an alternate setting that is not there is chosen"
    no_endpoints = usb.halt(0x00), usb.halt(0x83), usb.clear_halt(0x01), usb.status_of(0x0F)
    for request in (*no_endpoints, (0x00, 3, 1, 0, 0)):  # endpoint 0, those that are not there, features of the device
        if usb.ask(board, request) is not None:
            yield f"what cannot be halted is: {request}"
    for endpoint in (usb.NOTIFY_IN, usb.BULK_IN, usb.BULK_OUT):
        yield from _halted(board, ring, endpoint)
    ring.clock()
    if ring.retries:
        yield "after a halt a command has to be sent again"


def _halted(board: BenchBoard, ring: LightRing, endpoint: int) -> Iterator[str]:
    """An endpoint stalls until its halt is cleared (USB 2.0, 9.4.5), and then says what it could not say meanwhile."""
    ring.clock()  # one packet each way: after the halt DATA0 comes anew
    halting = usb.status_of(endpoint), usb.halt(endpoint), usb.status_of(endpoint)
    if [usb.ask(board, request) for request in halting] != [b"\0\0", b"", b"\1\0"]:
        yield f"endpoint {endpoint} does not say that it is halted"
    before = len(board.host.received)
    board.host.send(encode(Packet(p.COMMANDS["CLOCK"].code, 99, bytes(8))))
    board.run(20_000)
    if board.host.stalled != {endpoint} or (endpoint != usb.NOTIFY_IN and len(board.host.received) != before):
        yield f"endpoint {endpoint} does not stall while it is halted"
    if [usb.ask(board, request) for request in (usb.clear_halt(endpoint), halting[0])] != [b"", b"\0\0"]:
        yield f"the halt of endpoint {endpoint} is not cleared"
    board.run(5_000)
    if board.host.received[before:].count(0) != 1:
        yield f"a packet lost, or doubled, by a halt of endpoint {endpoint}"


STATUS_PIN, SWITCH_PIN = 16, 6


def _blinks(board: BenchBoard, duration_us: float) -> set[int]:
    """Half periods of the status LED, ms, rounded to 10; empty where it is steady."""
    times: list[float] = []
    board.chip.gpio[STATUS_PIN].add_listener(lambda _new, _old: times.append(board.now_us))
    board.run(duration_us)
    return {round((after - before) / 1e4) * 10 for before, after in pairwise(times)}


def wiring(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """All pins elsewhere, twice the LEDs, of another kind; the pulse of the output, the patterns of the status LED."""
    ring = reopen(board)
    ring.blank()
    board.run(3_000)
    wired = replace(ring.configuration(), data_pin=9, trigger_pin=THERMISTOR_PIN, output_pin=17,
                    output_at=OutputAt.MIDDLE, status_pin=STATUS_PIN + p.ACTIVE_LOW,
                    switch_pin=SWITCH_PIN + p.ACTIVE_LOW, led_count=24, colour_order=ColourOrder.RGBW)  # fmt: skip
    ring.configure(wired, save=True)
    board.power_off()
    other = BenchBoard(bytes(board.flash), strip=Strip(24, ColourOrder.RGBW, 9, SWITCH_PIN + p.ACTIVE_LOW))
    other.run_until(lambda: other.host.configured, 200_000)
    if _blinks(other, 1_600_000) != {500}:
        yield "the status LED does not blink slowly without a host"
    again = reopen(other)
    yield from _examine_wired(other, again)
    again.blank()
    other.run(600_000)
    if _blinks(other, 600_000) or other.chip.sio.gpio_value >> STATUS_PIN & 1:
        yield "the status LED is not steadily lit with a host"
    again.set_leds(np.tile(PATTERN, (2, 1)))
    other.run(30_000)
    before_us, resets = other.now_us, other.resets
    break_down(other)
    other.run(50)
    if other.timeline.at(before_us).any() == other.lit.any():
        yield "the load switch stays closed through a fault"
    other.run_until(lambda: other.resets > resets, 150_000)
    other.run_until(lambda: other.host.configured, 200_000)
    if _blinks(other, 500_000) != {100}:
        yield "the status LED does not show the fault"
    yield from other.faults


def _examine_wired(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    pattern = np.tile(PATTERN, (2, 1))
    ring.set_sync(SyncMode.EXT)
    ring.load_sequence([pattern], [Step(group=0, dwell_us=20_000, blank_us=20_000)], loops=2)
    changes: list[float] = []
    board.chip.gpio[17].add_listener(lambda _new, _old: changes.append(board.now_us))
    ring.start()
    board.run(p.SUPPLY_US + 12_000)  # the load switch has closed, and the main loop has looked
    begun = len(board.waveform.frame_starts_us)
    board.chip.gpio[THERMISTOR_PIN].set_input_value(True)
    board.run(5_000)
    if not np.array_equal(board.lit, pattern):
        yield "colours of a ring that is wired in another way"
    board.run(45_000)
    begun_us = board.waveform.frame_starts_us[begun]
    if len(changes) != 2 or abs(changes[0] - begun_us - 10_000) > 10 or abs(changes[1] - changes[0] - 100) > 5:
        yield "the trigger output"
    if board.chip.gpio[17].pad_value & OUTPUT_OFF:
        yield "the pad of the trigger output does not drive it"
    ring.blank()
    board.run(3_000)
    changes.clear()
    ring.set_sync(SyncMode.FREE)
    ring.load_sequence([pattern], [Step(group=0, dwell_us=60_000)])
    ring.start()
    board.run(25_000)  # the load switch has closed, and the middle is still to come
    lit = board.lit.any()
    ring.blank()
    board.run(60_000)
    if changes or not lit:
        yield "a pulse comes whose light was called off"
