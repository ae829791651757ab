"""Pins, number and order of the LEDs, trigger output and status LED of the committed image, as its flash says."""

import numpy as np
import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import ColourOrder, OutputAt, SyncMode
from gellight.ring.light_ring import Step
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator import registers
from tests.firmware.emulator.chip import VTOR
from tests.firmware.emulator.waveform import Strip
from tests.firmware.helpers.wiring import opened, wired
from tests.helpers.bench_board import RED, BenchBoard

OUTPUT, PULSE_US = 4, 100
DWELL_US = 20_000
TIMER_0, TIMER_2, INSTRUCTIONS = 0, 2, 24
"""interrupts; instructions of the one of a pulse"""


def levels(board: BenchBoard, pin: int) -> list[tuple[float, bool]]:
    """Every change of a pin that the board drives, from now on."""
    changes: list[tuple[float, bool]] = []
    board.chip.gpio[pin].add_listener(lambda new, _old: changes.append((board.now_us, int(new) == 1)))
    return changes


@pytest.mark.parametrize(("leds", "order"), [(1, 0), (24, 0), (24, 2), (16, 1), (12, 2)])
def test_any_number_of_leds_in_any_order_at_any_pin(image: bytes, leds: int, order: int) -> None:
    strip = Strip(leds, ColourOrder(order), 9)
    board = wired(image, strip, data_pin=9, led_count=leds, colour_order=order)
    pattern = (np.arange(3 * leds, dtype=np.uint8) * 5 % 61).reshape(leds, 3)
    with opened(board) as ring:
        assert ring.hello.led_count == ring.led_count == leds
        event = ring.wait_for_light(ring.set_leds(pattern).light_id)
        board.run(1_000)
        np.testing.assert_array_equal(board.lit, pattern)
        assert event.latched_us - event.first_bit_us == strip.bits * 1.25 + 301
        ring.load_sequence([pattern, pattern[::-1]], [Step(group=k, dwell_us=2_000) for k in range(2)])
        ring.set_sync(SyncMode.FREE)
        ring.start()
        board.run(40_000)
        assert ring.counters().late_steps == 0
    assert board.faults == []


@pytest.mark.parametrize("at", list(OutputAt))
def test_the_output_pulses_once_in_each_light(image: bytes, at: OutputAt) -> None:
    board = wired(image, output_pin=OUTPUT, output_at=at)
    with opened(board) as ring:
        ring.load_sequence([RED], [Step(group=0, dwell_us=DWELL_US, blank_us=DWELL_US)], loops=3)
        ring.set_sync(SyncMode.FREE)
        changes, since = levels(board, OUTPUT), len(board.waveform.frame_starts_us)
        ring.start()
        board.run(8 * DWELL_US)
        begun = board.waveform.frame_starts_us[since::2][:3]
        expected = [start + (DWELL_US / 2 if at is OutputAt.MIDDLE else 661) for start in begun]
        rises, falls = ([when for when, level in changes if level is up] for up in (True, False))
        assert len(rises) == len(falls) == 3
        np.testing.assert_allclose(rises, expected, atol=8)
        np.testing.assert_allclose(np.array(falls) - rises, PULSE_US, atol=5)
    assert board.faults == []


def test_a_light_that_latches_while_a_pulse_begins_takes_it_away(image: bytes) -> None:
    """At every instruction of the pulse's interrupt, which that of the light goes before."""
    board, risen = wired(image, output_pin=OUTPUT, output_at=OutputAt.MIDDLE), []
    with opened(board) as ring:
        ring.load_sequence([RED], [Step(group=0, dwell_us=DWELL_US)])
        ring.set_sync(SyncMode.FREE)
        changes = levels(board, OUTPUT)
        handler = board.chip.read_uint32(board.chip.read_uint32(VTOR) + 4 * (16 + TIMER_2))
        for after in range(INSTRUCTIONS):
            since, changes[:] = len(board.waveform.frame_starts_us), []
            ring.start()
            assert board.run_until(lambda n=since: len(board.waveform.frame_starts_us) > n, DWELL_US)
            board.run(DWELL_US / 2 - 400)
            board.host.send(encode(Packet(p.COMMANDS["BLANK"].code, 9, b"")))  # its light is on its way then
            end_us = board.now_us + 900
            while board.chip.core.pc | 1 != handler:
                board._run_slice(1e6, 1)
                assert board.now_us < end_us
            for _ in range(after):
                board._run_slice(1e6, 1)
            timer = board.chip.peripherals[registers.TIMER].inner
            timer._int_raw |= 1 << TIMER_0
            board.chip.core.set_interrupt(TIMER_0, True)
            latched_us = board.now_us
            risen.append(bool(changes))
            board.run(DWELL_US)
            assert [level for _, level in changes] in ([], [True, False]), after
            assert all(when < latched_us + 2 for when, _ in changes), after
    assert set(risen) == {False, True}, "all of what comes before the pulse begins was tried"
    assert board.faults == []
