"""A light that changes is told from a touch, and only where the bundle says so."""

from pathlib import Path

import numpy as np
import pytest

from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.reconstruction.light_drift import difference_of, light_drift
from tests.helpers.analytic_surfaces import gaussian
from tests.helpers.linear_sensor import bundle_of, photograph, reference_image

SHAPE = (240, 320)


ACROSS = np.linspace(-1, 1, SHAPE[1])[None, :, None]
LIGHTS = {
    "darker": 0.72,
    "brighter": 1.28,
    "of another colour": np.array([1.1, 1.0, 0.9]),
    "uneven": 1 + 0.05 * ACROSS,
}


def touched(light: float | np.ndarray) -> np.ndarray:
    """A picture whose touch, of a quarter of the view, has another light than its reference."""
    picture = reference_image(SHAPE) + np.random.default_rng(0).normal(0, 1, (*SHAPE, 3))
    picture[:100, :200] += 40
    return np.clip(np.rint(picture * light), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS)
def test_a_picture_under_other_light_differs_from_the_reference_by_its_touch_alone(light: float | np.ndarray) -> None:
    drift = light_drift(touched(light), reference_image(SHAPE))
    np.testing.assert_allclose(drift.over(SHAPE), np.broadcast_to(light, (*SHAPE, 3)), atol=0.002)
    assert drift.refusal == ""
    found = difference_of(touched(light), reference_image(SHAPE), follow_light=True)
    assert np.abs(found[120:].mean(axis=(0, 1))).max() < 0.1
    assert found[:100, :200].mean() == pytest.approx(40, rel=0.02)


def test_light_that_was_added_does_not_make_a_touch_stronger() -> None:
    picture = np.clip(touched(1.0) + np.array([9, 4, 0]), 0, 255).astype(np.uint8)
    drift = light_drift(picture, reference_image(SHAPE))
    assert not drift.multiplied
    assert difference_of(picture, reference_image(SHAPE), follow_light=True)[:100, :200].mean() == pytest.approx(
        40, abs=1
    )


@pytest.mark.parametrize(("light", "refused"), [(0.72, False), (0.68, True), (1.28, False), (1.32, True)])
def test_more_than_30_percent_is_not_taken_out(light: float, refused: bool) -> None:
    refusal = light_drift(touched(light), reference_image(SHAPE)).refusal
    assert bool(refusal) == refused
    if refused:
        assert "by up to 32%, at most 30% can be taken out: take both under the same light, or adapt" in refusal


@pytest.mark.parametrize("follow", [True, False])
def test_a_frame_under_other_light_is_reconstructed_by_a_bundle_that_follows_it(tmp_path: Path, follow: bool) -> None:
    bundle = bundle_of(tmp_path / "bundle", reference_image(SHAPE), follow_light=follow)
    bump = gaussian(SHAPE, 12, (0, 0), height=10)
    frame = photograph(bump.gradient_map, noise_grey=1.0)
    brighter = CameraFrame(image=frame.image + np.array([9, 4, 0], np.uint8), time_s=0.0, sequence=1)
    felt = Reconstructor(bundle).reconstruct(brighter)
    error_mm = np.abs(felt.depth_mm - bump.depth * bundle.pixel_size_mm[0]).max()
    assert (error_mm < 0.03) == follow
