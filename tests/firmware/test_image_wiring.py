"""The committed image as its flash says it is wired: LEDs, trigger output, thermistor; it dims what is hot."""

import logging
import re
from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.lab.doctor.sensor_checks import check_board
from gellight.ring import protocol as p
from gellight.ring.enumerations import ColourOrder, OutputAt, SyncMode
from gellight.ring.light_ring import LightRing, Step
from gellight.ring.protocol import DIMMING_US, HOTTEST_C, DimmedEvent
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator import registers
from tests.firmware.emulator.chip import VTOR
from tests.firmware.emulator.waveform import Strip
from tests.helpers.bench_board import RED, BenchBoard, VirtualTransport


def opened(board: BenchBoard) -> LightRing:
    return LightRing(VirtualTransport(board), keep_alive_s=None)


def wired(image: bytes, strip: Strip | None = None, **fields: int) -> BenchBoard:
    """A board that was configured so and has started anew; its LEDs may be others than before."""
    before = BenchBoard(image)
    ring = opened(before)
    ring.configure(replace(ring.configuration(), **fields), save=True)
    before.power_off()
    board = BenchBoard(bytes(before.flash), strip=strip)
    assert before.faults == []
    return board


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


DIM_RED = np.tile(np.array((100, 0, 0), np.uint8), (12, 1))


def attend(ring: LightRing, board: BenchBoard, duration_us: float) -> None:
    """Do what the keep-alive thread does, on the board's time."""
    end_us = board.now_us + duration_us
    while board.now_us < end_us:
        ring.clock()
        ring._light_again()
        board.run(250_000)


def test_a_hot_board_dims_its_leds_and_the_host_says_so(
    board: BenchBoard, ring: LightRing, caplog: pytest.LogCaptureFixture
) -> None:
    ring.light(DIM_RED)
    attend(ring, board, 1e6)
    assert np.isfinite(ring.lit_since_s())
    board.set_temperature(HOTTEST_C + 8)
    with caplog.at_level(logging.WARNING):
        attend(ring, board, 8e6)
    np.testing.assert_array_equal(board.lit, DIM_RED // 2)
    assert ring.lit_since_s() == np.inf  # no frame is of the light that was asked for
    assert (ring.dimmed, ring.status().dimmed) == (1, 1)
    told = re.search(r"board has (\d+) °C", caplog.text)
    assert told
    assert 60 <= int(told[1]) <= 62, "its mean, which has just passed 60"
    assert "dims its LEDs to 1/2" in caplog.text
    attend(ring, board, DIMMING_US)
    np.testing.assert_array_equal(board.lit, DIM_RED // 4)
    with pytest.raises(BoardError, match="dims its LEDs to 1/4: let it cool"):
        ring.light(DIM_RED)
    finding = check_board(ring)
    assert "dims its LEDs to 1/4" in finding.remedy


def test_a_board_that_has_cooled_shows_the_light_again(
    board: BenchBoard, ring: LightRing, caplog: pytest.LogCaptureFixture
) -> None:
    ring.light(DIM_RED)
    board.set_temperature(HOTTEST_C + 8)
    attend(ring, board, 8e6)
    board.set_temperature(HOTTEST_C - 20)
    with caplog.at_level(logging.WARNING):
        attend(ring, board, DIMMING_US)
    assert "the board is cool again; they are lit again" in caplog.text
    np.testing.assert_array_equal(board.lit, DIM_RED)
    assert np.isfinite(ring.lit_since_s())
    assert ring.dimmed == 0
    assert [event.dimmed for event in ring.events if isinstance(event, DimmedEvent)] == [1, 0]
