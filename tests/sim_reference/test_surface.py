"""The forms of the objects; a press placed under the pixels is the same surface, moved."""

import numpy as np
import pytest

from sim_reference.deformation import NO_OBJECT, Deformation
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.objects import OBJECT_NAMES, ObjectParameters, object_height
from sim_reference.surface import press_object, sample, untouched

GEOMETRY = SensorGeometry()
BALL = press_object("BALL", 1.0, GEOMETRY)
AXIS = np.linspace(-20, 20, 801)  # 0.05 mm
X, Y = AXIS[None, :], AXIS[:, None]


def height(name: str) -> np.ndarray:
    return object_height(name, X, Y)


def test_the_relief_follows_its_parameter() -> None:
    low = object_height("SINWAVE", X, Y, ObjectParameters(relief_mm=0.5))
    assert low[np.hypot(X, Y) < 17].min() == pytest.approx(-0.5, abs=2e-3)


@pytest.mark.parametrize("name", OBJECT_NAMES)
def test_an_object_has_its_highest_point_at_0_its_relief_and_its_reach(name: str) -> None:
    fine = np.linspace(-2.5, 2.5, 2001)  # a crest, a ball or a polygon of each lies there
    assert -2e-3 < object_height(name, fine[None, :], fine[:, None]).max() <= 1e-9
    there = height(name) > NO_OBJECT / 2
    relief_mm = {"BALL": 4.0, "BSWAVE": 2.0}.get(name, ObjectParameters().relief_mm)
    assert -height(name)[there].min() == pytest.approx(relief_mm, abs=0.15)
    assert np.hypot(X, Y)[there].max() == pytest.approx(4.0 if name == "BALL" else 17.5, abs=0.1)


def test_ball_crown_and_caves_are_those_of_the_paper() -> None:
    """A sphere of 4 mm, a crown 1 mm high over a base of 2 mm, and the balls turned inside out."""
    ball, crown, r = height("BALL"), height("SCROWN"), np.hypot(X, Y)
    on_ball, plate = r < 3.9, r < 17
    np.testing.assert_allclose(r[on_ball] ** 2 + (ball[on_ball] + 4) ** 2, 16.0, rtol=1e-6)
    assert (crown[(r > 2.01) & plate] == -1).all()
    assert (crown[r < 1.99] > -1).all()
    np.testing.assert_allclose((height("BALLVEX") + height("BALLCAVE"))[plate], -1.0, rtol=1e-6)


@pytest.mark.parametrize("name", ["SINWAVE", "WAVE"])
def test_waves_repeat_after_a_wavelength(name: str) -> None:
    profile = height(name)[400, 401:700]
    assert profile[50:] == pytest.approx(profile[:-50], abs=1e-9)  # 50 steps of 0.05 mm


def test_straight_waves_are_straight_and_circular_ones_round() -> None:
    inner = slice(300, 501)
    straight, round_ = height("SINWAVE")[inner, inner], height("WAVE")[inner, inner]
    assert (straight == straight[0]).all()
    assert round_ == pytest.approx(round_.T)
    assert round_ == pytest.approx(round_[::-1], abs=1e-9)


@pytest.mark.parametrize("name", OBJECT_NAMES)
def test_an_object_lies_the_same_on_a_coarse_grid(name: str) -> None:
    assert object_height(name, X[:, ::20], Y[::20]) == pytest.approx(height(name)[::20, ::20], abs=1e-9)


def test_slopes_are_the_derivatives_of_the_depth() -> None:
    surface = sample(BALL, GEOMETRY, 1.234, -0.567)
    depth, pixel = surface.depth_mm, GEOMETRY.pixel_size_mm
    # Fourth-order central differences; the spline's third derivative jumps at its knots, so some 0.001 remains.
    right = (8 * (depth[:, 3:-1] - depth[:, 1:-3]) - (depth[:, 4:] - depth[:, :-4])) / (12 * pixel)
    down = (8 * (depth[3:-1] - depth[1:-3]) - (depth[4:] - depth[:-4])) / (12 * pixel)
    np.testing.assert_allclose(surface.gradient_map[:, 2:-2, 0], right, rtol=0, atol=2e-3)
    np.testing.assert_allclose(surface.gradient_map[2:-2, :, 1], down, rtol=0, atol=2e-3)


def test_the_deepest_point_is_where_the_object_is_pressed() -> None:
    surface = sample(BALL, GEOMETRY, 5.0, -3.0)
    row, column = np.unravel_index(surface.depth_mm.argmax(), surface.depth_mm.shape)
    x, y = pixel_grid(GEOMETRY)
    assert x[0, column] == pytest.approx(5.0, abs=0.06)
    assert y[row, 0] == pytest.approx(-3.0, abs=0.06)


def test_a_shift_by_whole_pixels_shifts_the_map() -> None:
    here = sample(BALL, GEOMETRY, 0.0, 0.0)
    there = sample(BALL, GEOMETRY, 10 * GEOMETRY.pixel_size_mm, 0.0)
    np.testing.assert_allclose(there.depth_mm[:, 110:-100], here.depth_mm[:, 100:-110], rtol=0, atol=1e-9)
    # The contact is sampled from a coarser grid: its rim may move by a pixel.
    assert (there.contact[:, 110:-100] != here.contact[:, 100:-110]).sum() < 0.05 * here.contact.sum()


def test_far_from_the_object_the_gel_is_at_rest() -> None:
    surface = sample(BALL, GEOMETRY, 0.0, 0.0)
    assert np.abs(surface.depth_mm[:, 0]).max() < 0.003
    assert not surface.contact[:, 0].any()
    assert not sample(BALL, GEOMETRY, 200.0, 0.0).depth_mm.any(), "beside the view"
    assert not untouched(GEOMETRY).contact.any()


def imprint(height: np.ndarray, spacing: float, depth: float, geometry: SensorGeometry) -> Deformation:
    """The plainest model of a gel: it takes the object's form and nothing more."""
    pressed = np.maximum(height + depth, 0.0)
    return Deformation(pressed, (pressed > 0).astype(float), spacing)


def test_another_model_of_the_gel_takes_the_place_of_the_layer() -> None:
    surface = sample(press_object("BALL", 1.0, GEOMETRY, model=imprint), GEOMETRY, 0.0, 0.0)
    radius_mm = np.sqrt(surface.contact.sum() / np.pi) * GEOMETRY.pixel_size_mm
    # The edge of the imprint is that of equation 8, r_e^2 = R^2 - (R - d)^2; the layer touches less.
    assert radius_mm == pytest.approx(np.sqrt(16 - 9), abs=0.05)
    assert sample(BALL, GEOMETRY, 0.0, 0.0).contact.sum() < surface.contact.sum()


def test_a_place_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        sample(BALL, GEOMETRY, float("nan"), 0.0)
