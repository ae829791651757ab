"""The phase lock: what it tells the board puts each frame in the middle of its light."""

import numpy as np
import pytest

from gellight.frames.camera import CameraTiming
from gellight.ring import protocol
from gellight.sensor.lighting.clock import Interval
from gellight.sensor.lighting.lock import FEWEST_FRAMES, PhaseLock, hold_frames, settle_s

TIMING = CameraTiming(stamp_delay_s=0.002, stamp_error_s=0.0002)
PERIOD_S, BEGIN_S = TIMING.period_s, 5.0
RESTING = Interval(0.0, 0.0)
WIRE_AND_LATCH_S = 12 * 30e-6 + 0.3e-3


def lock_of(frames: int, count: int = 40, dwell_us: int = round(PERIOD_S * 1e6)) -> PhaseLock:
    """A lock that has seen frames whose stamps are exact."""
    lock = PhaseLock(TIMING, frames=frames)
    lock.dwell_us = frames * dwell_us
    for number in range(count):
        lock.note_frame(number, BEGIN_S + number * PERIOD_S)
    return lock


def margins(latched_s: Interval, frames: int) -> tuple[float, float]:
    """From when a light surely shows to the begin of the next frame, and from its end to the next light, both s."""
    shows_s = latched_s.high + TIMING.pulse_period_s + TIMING.stamp_error_s
    frame_s = BEGIN_S + TIMING.stamp_delay_s
    before_s = (frame_s - shows_s) % PERIOD_S
    ends_s = shows_s + before_s + TIMING.duration_s
    return before_s, latched_s.low + frames * PERIOD_S - WIRE_AND_LATCH_S - TIMING.stamp_error_s - ends_s


def test_the_light_is_uncertain_for_wire_latch_a_pulse_and_both_errors_on_either_side() -> None:
    assert settle_s(TIMING, 1e-4) == pytest.approx(WIRE_AND_LATCH_S + 0.0025 + 2 * (1e-4 + 2e-4))
    assert settle_s(TIMING, leds=24) == pytest.approx(settle_s(TIMING) + 12 * 30e-6)


@pytest.mark.parametrize("frames", [1, 2])
@pytest.mark.parametrize("late_s", np.linspace(0, PERIOD_S, 8)[:-1])
def test_after_a_trim_each_frame_is_in_the_middle_of_its_light(frames: int, late_s: float) -> None:
    assert frames >= hold_frames(TIMING)
    lock, latched_s = lock_of(frames), BEGIN_S + 1 + late_s
    trim = lock.trim(Interval(latched_s - 1e-4, latched_s + 1e-4), RESTING)
    if trim is not None:
        assert -0.001 <= trim.phase_us * 1e-6 < PERIOD_S, "a light on its way cannot come much earlier"
        latched_s += trim.phase_us * 1e-6
    before_s, after_s = margins(Interval(latched_s - 1e-4, latched_s + 1e-4), frames)
    slack_s = frames * PERIOD_S - settle_s(TIMING, 1e-4) - TIMING.duration_s
    assert before_s + after_s == pytest.approx(slack_s)
    assert abs(before_s - after_s) <= (2e-6 if trim else 0.2 * slack_s)
    again = lock.trim(Interval(latched_s - 1e-4, latched_s + 1e-4), RESTING)
    assert again is None


@pytest.mark.parametrize("drift", [-1e-4, 0.0, 1e-4])
def test_the_lights_are_made_as_long_as_their_frames_by_the_clock_of_the_board(drift: float) -> None:
    trim = lock_of(2, dwell_us=33_330).trim(Interval(6.0, 6.0), Interval(drift - 1e-5, drift + 1e-5))
    assert 2 * 33_330 * (1 + trim.period) == pytest.approx(2 * PERIOD_S * 1e6 * (1 + drift), abs=1e-3)


@pytest.mark.parametrize(("dwell_us", "sign"), [(30_000, 1), (36_000, -1)])
def test_no_more_is_asked_than_the_board_can_do(dwell_us: int, sign: int) -> None:
    trim = lock_of(2, dwell_us=dwell_us).trim(Interval(6.0, 6.0), RESTING)
    assert round(trim.period * 2**32) == sign * protocol.TRIM_MAX


def test_a_trim_is_told_once_until_its_light_has_come_and_few_frames_tell_nothing() -> None:
    lock, late_s = lock_of(1), Interval(6.0, 6.0)
    assert lock.trim(late_s, RESTING) is not None
    for number in range(40, 43):
        lock.note_frame(number, BEGIN_S + number * PERIOD_S)
        assert lock.trim(late_s, RESTING) is None
    lock.note_frame(43, BEGIN_S + 43 * PERIOD_S)
    assert lock.trim(late_s, RESTING) is not None
    lock = lock_of(1, FEWEST_FRAMES - 1)
    assert not lock.ready
    assert lock.trim(Interval(6.0, 6.0), RESTING) is None
    with pytest.raises(ValueError, match="11 frames do not tell"):
        lock.line()
    lock.note_frame(10, 99.0)
    assert not lock.ready, "a frame counts once"
    lock.note_frame(FEWEST_FRAMES, BEGIN_S + FEWEST_FRAMES * PERIOD_S)
    assert lock.line() == pytest.approx((BEGIN_S + FEWEST_FRAMES * PERIOD_S, PERIOD_S))
