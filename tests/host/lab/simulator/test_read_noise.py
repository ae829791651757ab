"""The noise of the simulated camera is as good as noise that is drawn for every frame."""

import numpy as np
import pytest

from gellight.lab.simulator.shutter import ReadNoise
from gellight.reconstruction.fine_pattern import FinePattern
from sim_reference.camera import digitise

GREY = np.random.default_rng(3).uniform(60, 180, (120, 160, 3)).astype(np.float32)


@pytest.mark.parametrize("noise_grey", [0.0, 1.0, 3.0])
def test_pictures_have_the_mean_and_the_noise_of_the_reference(noise_grey: float) -> None:
    noise, rng = ReadNoise(np.random.default_rng(1)), np.random.default_rng(2)
    ours = np.stack([noise.digitise(GREY, noise_grey) for _ in range(100)]).astype(float)
    theirs = np.stack([digitise(GREY, noise_grey, rng) for _ in range(100)]).astype(float)
    assert ours.mean() == pytest.approx(theirs.mean(), abs=0.01)
    assert ours.std(axis=0).mean() == pytest.approx(theirs.std(axis=0).mean(), rel=0.01, abs=1e-9)
    averaged = np.abs(ours.mean(axis=0) - GREY).mean()
    assert averaged == pytest.approx(np.abs(theirs.mean(axis=0) - GREY).mean(), rel=0.03)


def test_noise_is_independent_from_pixel_to_pixel_and_from_frame_to_frame() -> None:
    noise = ReadNoise(np.random.default_rng(1))
    first, second = ((noise.digitise(GREY, 5.0) - GREY).ravel() for _ in range(2))
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.02
    assert abs(np.corrcoef(first[:-1], first[1:])[0, 1]) < 0.02


def test_no_frame_repeats_the_noise_of_another_shifted() -> None:
    """By the best match within 20 pixels a bundle of another unit is found out (`reconstruction.fine_pattern`)."""
    grey, noise = np.full((240, 320, 3), 120, np.float32), ReadNoise(np.random.default_rng(1))
    first = FinePattern(noise.digitise(grey, 5.0))
    assert max(first.match(noise.digitise(grey, 5.0)) for _ in range(60)) < 8


def test_what_is_out_of_range_is_clipped() -> None:
    noise = ReadNoise(np.random.default_rng(1))
    assert set(np.unique(noise.digitise(np.full((40, 40, 3), 400, np.float32), 1.0))) == {255}
    assert set(np.unique(noise.digitise(np.full((40, 40, 3), -40, np.float32), 1.0))) == {0}
