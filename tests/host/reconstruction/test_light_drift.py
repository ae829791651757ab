"""A light that changes is told from a touch, and only where the bundle says so."""

from pathlib import Path

import numpy as np
import pytest

from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.reconstruction.light_drift import light_drift
from tests.helpers.analytic_surfaces import gaussian
from tests.helpers.linear_sensor import bundle_of, photograph, reference_image

SHAPE = (240, 320)


def test_the_drift_is_found_under_a_touch() -> None:
    difference = np.random.default_rng(0).normal(0, 1, (*SHAPE, 3)).astype(np.float32)
    difference[:100, :200] += 80  # a quarter of the view is touched
    drifted = difference + np.array([5.0, -3.0, 12.0], np.float32)
    # The touch shifts the median of the rest by 0.43 standard deviations of the noise.
    assert light_drift(drifted) == pytest.approx([5.0, -3.0, 12.0], abs=0.6)


@pytest.mark.parametrize("follow", [True, False])
def test_a_frame_under_other_light_is_reconstructed_by_a_bundle_that_follows_it(tmp_path: Path, follow: bool) -> None:
    bundle = bundle_of(tmp_path / "bundle", reference_image(SHAPE), follow_light=follow)
    bump = gaussian(SHAPE, 12, (0, 0), height=10)
    frame = photograph(bump.gradient_map, noise_grey=1.0)
    brighter = CameraFrame(image=frame.image + np.array([9, 4, 0], np.uint8), time_s=0.0, sequence=1)
    felt = Reconstructor(bundle).reconstruct(brighter)
    error_mm = np.abs(felt.depth_mm - bump.depth * bundle.pixel_size_mm[0]).max()
    assert (error_mm < 0.03) == follow
