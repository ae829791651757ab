"""The committed image on an emulated RP2040: the waveform on the pin, time, a second of sleep."""

import numpy as np
import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import SyncMode
from gellight.ring.light_ring import LightRing, Step
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator.waveform import WINDOWS_NS
from tests.helpers.bench_board import GREEN, RED, BenchBoard

PATTERN = np.arange(36, dtype=np.uint8).reshape(12, 3) * 7 % 97
JITTER_US = 1.0


def starts(board: BenchBoard, since: int) -> np.ndarray:
    """First bits of the frames on the pin, on the firmware's clock (the chip was not restarted)."""
    return np.array(board.waveform.frame_starts_us[since:])


# ---- the wire ----


def test_the_leds_are_dark_before_the_board_is_on_the_bus(image: bytes) -> None:
    board = BenchBoard(image)
    board.run_until(lambda: board.host.configured, 200_000)
    assert len(board.timeline) == 1
    assert not board.timeline[0].colours.any()
    assert board.waveform.frame_starts_us[0] < 64_000 + 2_000 < board.now_us  # the crystal takes 64 ms


def test_every_bit_keeps_the_windows_of_the_data_sheets(board: BenchBoard, ring: LightRing) -> None:
    ring.set_leds(PATTERN)
    board.run(2_000)
    bits = board.waveform.bits
    assert len(bits) == board.waveform.strip.bits == 288
    for bit in bits:
        name = "T1" if bit.high_ns > 500 else "T0"
        assert WINDOWS_NS[name + "H"][0] <= bit.high_ns <= WINDOWS_NS[name + "H"][1]
        assert bit.low_ns is None or WINDOWS_NS[name + "L"][0] <= bit.low_ns <= WINDOWS_NS[name + "L"][1]
    highs = {round(bit.high_ns) for bit in bits}
    periods = {round(bit.high_ns + bit.low_ns) for bit in bits if bit.low_ns}
    assert highs == {333, 667}
    assert periods == {1250}
    np.testing.assert_array_equal(board.lit, PATTERN)


def test_an_led_frame_is_never_torn(board: BenchBoard, ring: LightRing) -> None:
    """Lights that follow each other faster than the wire: some are left out, none is mixed."""
    shades = [np.full((12, 3), value, np.uint8) for value in range(1, 60)]
    code, before = p.COMMANDS["SET_LEDS"].code, len(board.timeline)
    for number, shade in enumerate(shades):
        board.host.send(encode(Packet(code, 100 + number, shade.tobytes())))
        board.run(137.0)
    board.run(20_000)
    shown = [board.timeline[i].colours for i in range(before, len(board.timeline))]
    assert 5 < len(shown) < len(shades)
    assert all((colours == colours[0, 0]).all() for colours in shown)
    np.testing.assert_array_equal(shown[-1], shades[-1])


def test_the_event_tells_when_the_first_bit_left_the_pin(board: BenchBoard, ring: LightRing) -> None:
    event = ring.wait_for_light(ring.set_leds(RED).light_id)
    # the clock counts whole microseconds, and the first bit rises 0.6 us after the transfer has begun
    assert 0 <= board.waveform.frame_starts_us[-1] - board.timer_began_us - event.first_bit_us < 2
    latched = board.timeline[-1].time_us - board.timer_began_us
    assert latched <= event.latched_us <= latched + 25


# ---- time ----


@pytest.mark.nightly
def test_the_fastest_sequence_keeps_its_time_under_the_longest_commands(board: BenchBoard, ring: LightRing) -> None:
    """A whole table is loaded again and again, which takes all 32 steps' checksum, while the shortest steps run."""
    since = len(board.waveform.frame_starts_us)
    steps = [Step(group=k % 2, dwell_us=p.DWELL_MIN_US) for k in range(p.STEP_COUNT)]
    ring.load_sequence([RED, GREEN], steps)
    ring.set_sync(SyncMode.FREE)
    ring.start()
    for _ in range(24):
        ring.counters()
        ring.configuration()
        ring.load_sequence([RED, GREEN], steps)
    times = starts(board, since)
    assert len(times) > 60
    assert np.abs(times - times[0] - p.DWELL_MIN_US * np.arange(len(times))).max() <= JITTER_US
    assert ring.counters().late_steps == 0


def test_a_second_of_sleep_costs_nothing(board: BenchBoard, ring: LightRing) -> None:
    before = ring.clock().received_us
    board.run(1_000_000)
    assert abs(ring.clock().received_us - before - 1_000_000) < 2_000
