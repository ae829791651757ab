"""The tilt of the whole surface is taken off where rest is seen on three sides, and the frame says so."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle
from gellight.evaluation.analytic_surfaces import gaussian
from gellight.reconstruction.pipeline import Form, Reconstructor
from gellight.reconstruction.tilt import take_tilt_off
from tests.helpers.linear_sensor import linear_bundle, photograph

SHAPE = (160, 200)
TILT = (0.006, -0.004)
"""slopes too gentle to be a touch to a sensor whose gel at rest differs by a grey level"""


def unsteady(folder: Path, rest_grey: float = 1.0) -> Bundle:
    bundle = linear_bundle(folder / "b", SHAPE)
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"rest_grey": rest_grey}))


@pytest.mark.parametrize("form", [Form.NATIVE, Form.CELLS, Form.PIXELS])
def test_a_tilt_is_taken_off_and_the_frame_says_so(tmp_path: Path, form: Form) -> None:
    bundle = unsteady(tmp_path)
    press = gaussian(SHAPE, 12, (10, -5), height=9)
    image = photograph(press.gradient_map + np.array(TILT, np.float32))
    frame = Reconstructor(bundle, form=form).reconstruct(image)
    right = press.depth * bundle.pixel_size_mm[0]
    assert frame.flags == ("levelled",)
    assert np.abs(frame.depth_mm - right).mean() < 0.002
    # Without: half of the view's width times the slope, in the mean over both axes.
    steady = replace(bundle, manifest=bundle.manifest.model_copy(update={"rest_grey": 0.49}))
    tilted = Reconstructor(steady, form=form).reconstruct(image)
    assert tilted.flags == ()
    assert np.abs(tilted.depth_mm - right).mean() > 0.01


def test_rest_on_two_sides_tells_no_tilt(tmp_path: Path) -> None:
    bundle = unsteady(tmp_path)
    slopes = np.zeros((*SHAPE, 2), np.float32)
    slopes[:, 30:, 0] = 0.3 * np.sin(np.linspace(0, 20, 170))
    for form in (Form.NATIVE, Form.CELLS):
        assert Reconstructor(bundle, form=form).reconstruct(photograph(slopes)).flags == ()


def test_the_plane_is_that_of_the_gel_at_rest_and_not_of_the_press() -> None:
    touched = np.zeros(SHAPE, np.bool_)
    touched[50:90, 120:160] = True
    y, x = np.indices(SHAPE)
    plane = 0.001 * (x - 99.5) - 0.002 * (y - 79.5)
    depth = (plane + 5.0 * touched + 0.3).astype(np.float32)
    assert take_tilt_off(depth, touched)
    np.testing.assert_allclose(depth, 5.0 * touched + 0.3, atol=1e-4)
    alone = plane.astype(np.float32)
    assert not take_tilt_off(alone, np.zeros(SHAPE, np.bool_)), "nothing touches: the zero's business"
    np.testing.assert_array_equal(alone, plane.astype(np.float32))
