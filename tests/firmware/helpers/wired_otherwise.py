"""A check of a firmware image: a ring that is wired otherwise than a board as it comes."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gellight.ring import protocol as p
from gellight.ring.enumerations import ColourOrder, OutputAt, SyncMode
from gellight.ring.light_ring import LightRing, Step
from tests.firmware.emulator.analog import OUTPUT_OFF, THERMISTOR_PIN
from tests.firmware.emulator.waveform import Strip
from tests.firmware.helpers.examined_board import PATTERN, break_down, reopen
from tests.helpers.bench_board import BenchBoard

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
