"""The smallest hold: enough at every phase, and one frame less is not; by brute force, without the formula."""

import numpy as np
import pytest

from gellight.frames.timing import CameraTiming
from gellight.sensor.lighting.lock import hold_frames, settle_s

PHASES = np.linspace(0, 1, 2001)[:-1]


def clean_frames(timing: CameraTiming, frames: int) -> np.ndarray:
    """Count, for each phase, the frames between the settling of a light and the end of its hold, `frames` periods.

    The phase is when the first frame after the settling begins, in periods.
    """
    begins = (PHASES[:, None] + np.arange(frames + 1)) * timing.period_s + settle_s(timing)
    return np.asarray((begins + timing.duration_s <= frames * timing.period_s + 1e-12).sum(axis=1))


@pytest.fixture(scope="module")
def cameras() -> list[CameraTiming]:
    rng = np.random.default_rng(0)
    return [
        CameraTiming(
            period_s=(period := 1 / rng.uniform(10, 240)),
            exposure_s=rng.uniform(0.01, 1) * period,
            readout_s=rng.uniform(0, 1) * period,
            stamp_error_s=rng.choice([0.0, 1e-3]),
            pulse_period_s=rng.choice([5e-4, 2.5e-3]),
        )
        for _ in range(300)
    ]


def test_at_an_unknown_phase_every_light_has_a_clean_frame_and_not_with_one_less(cameras: list[CameraTiming]) -> None:
    for timing in cameras:
        frames = hold_frames(timing, locked=False)
        assert clean_frames(timing, frames).min() >= 1
        assert clean_frames(timing, frames - 1).min() == 0


def test_when_locked_some_phase_gives_every_light_a_clean_frame_and_with_one_less_none_does(
    cameras: list[CameraTiming],
) -> None:
    for timing in cameras:
        frames = hold_frames(timing, locked=True)
        assert clean_frames(timing, frames).max() >= 1
        assert clean_frames(timing, frames - 1).max() == 0


@pytest.mark.parametrize(
    ("readout", "exposure", "unlocked", "locked"),
    [(0.9, 0.3, 3, 2), (0.3, 0.3, 2, 1)],
    ids=["a cheap camera whose readout fills the period", "short readout and exposure"],
)
def test_it_is_as_known_for_two_cameras(readout: float, exposure: float, unlocked: int, locked: int) -> None:
    period = 1 / 30
    timing = CameraTiming(period_s=period, readout_s=readout * period, exposure_s=exposure * period)
    assert (hold_frames(timing, locked=False), hold_frames(timing, locked=True)) == (unlocked, locked)


def test_an_uncertain_clock_takes_longer() -> None:
    timing = CameraTiming(readout_s=0.020, exposure_s=0.008)
    assert hold_frames(timing, locked=True) == 1
    assert hold_frames(timing, locked=True, clock_error_s=0.001) == 2
