"""The layer for a stream of gaps, its pictures, those of a calibrated unit, and the depth that carries a force."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.dots import find_dots
from gellight.lab.simulator.measured_light import MeasuredLight
from gellight.lab.simulator.printed_dots import PrintedDots
from gellight.lab.simulator.scene import Press, Printed, Scene
from gellight.opening import open_camera
from gellight_touch import Felt, TouchSensor
from gellight_touch.layer import NOTHING
from gellight_touch.picture import Splines
from sim_reference import gel
from sim_reference.camera import CameraResponse
from sim_reference.geometry import AS_BUILT, SensorGeometry, pixel_grid
from sim_reference.objects import object_height
from tests.helpers.pressed_unit import NOISE_GREY, SHAPE, pressed_unit

GEOMETRY = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=0.2352)


@pytest.fixture
def touch() -> TouchSensor:
    return TouchSensor(GEOMETRY)


def gap_of(touch: TouchSensor, name: str, depth_mm: float, x_mm: float = 0.0) -> np.ndarray:
    at = touch.layer.at_mm
    return -(object_height(name, at[None, :] - x_mm, at[:, None]) + depth_mm)


@pytest.mark.parametrize("name", ["BALL", "TSTEP"])
def test_a_gap_is_felt_as_the_reference_presses(touch: TouchSensor, name: str) -> None:
    at, spacing_mm = touch.layer.at_mm, touch.layer.spacing_mm
    height = object_height(name, at[None, :], at[:, None])
    pressed = gel.press(height, spacing_mm, 0.9, GEOMETRY)
    felt = touch.feel(gap_of(touch, name, 0.9))
    np.testing.assert_allclose(felt.depth_mm, pressed.depth_mm, rtol=0, atol=2e-4)
    assert felt.depth_mm.dtype == np.float32
    shear_modulus_mpa = 0.2 / 2 / (1 + GEOMETRY.poisson_ratio)
    assert felt.force_n == pytest.approx(pressed.pressure.sum() * spacing_mm**2 * shear_modulus_mpa, rel=1e-3)


def square(extent_mm: float, half_mm: float) -> float:
    """The force of a square, 0.2 mm deep."""
    touch = TouchSensor(GEOMETRY, size=round(2 * extent_mm), extent_mm=extent_mm)
    at = np.abs(touch.layer.at_mm)
    return touch.feel(np.where(np.maximum(at[None, :], at[:, None]) < half_mm, -0.2, NOTHING)).force_n


def test_a_contact_keeps_two_thicknesses_from_the_border_of_its_periodic_grid() -> None:
    assert square(32.0, 6.0) == pytest.approx(square(128.0, 6.0), rel=0.03)
    with pytest.raises(ValueError, match=r"beyond 6 mm from the middle of a grid of 32 mm, .* give a larger extent_mm"):
        square(32.0, 6.6)


def test_what_was_felt_before_changes_nothing(touch: TouchSensor) -> None:
    first = touch.feel(gap_of(touch, "BALL", 0.5, 3.0))
    touch.feel(gap_of(touch, "TSTEP", 1.5, -4.0))
    assert (touch.feel(gap_of(touch, "BALL", 0.5, 3.0)).depth_mm == first.depth_mm).all()
    assert touch.feel(np.full_like(first.depth_mm, 0.1)).force_n == 0


def test_the_force_acts_where_the_ball_is(touch: TouchSensor) -> None:
    assert touch.feel(gap_of(touch, "BALL", 0.5, 3.0)).centre_mm == pytest.approx((3.0, 0.0), abs=0.01)
    assert touch.feel(gap_of(touch, "BALL", -0.1)).centre_mm == (0.0, 0.0)


@pytest.mark.parametrize("exponent_deg", [120.0, 160.0])
@pytest.mark.parametrize(("name", "mean_grey", "most_grey"), [("BALL", 0.02, 0.1), ("WAVE", 1.0, 12.0)])
def test_a_surface_looks_as_in_the_simulated_sensor(
    name: str, mean_grey: float, most_grey: float, exponent_deg: float
) -> None:
    """On the same grid; cast shadows have their edges on cells of another size."""
    geometry = replace(GEOMETRY, beam_angle_rad=np.deg2rad(exponent_deg))
    touch = TouchSensor(geometry, size=512)
    scene = Scene(geometry, CameraResponse())
    shown, surface = scene.show(Press(name, 0.9))
    felt = touch.feel(gap_of(touch, name, 0.9))
    off = np.abs(touch.grey(felt) - shown)
    assert off.mean() < mean_grey
    assert np.quantile(off, 0.99) < most_grey
    np.testing.assert_allclose(touch.depth_map_mm(felt), surface.depth_mm, rtol=0, atol=2e-3)


@pytest.mark.parametrize(
    ("name", "x_mm", "mean_grey", "mean_mm", "most_mm"),
    [("BALL", 9.0, 3e-3, 2e-5, 1e-3), ("TSTEP", 4.0, 0.05, 2e-4, 0.03)],
)
def test_a_surface_looks_as_in_the_simulated_sensor_behind_its_window_from_its_height(
    name: str, x_mm: float, mean_grey: float, mean_mm: float, most_mm: float
) -> None:
    """Between the pixels the surface is linear here; a step is off at its edges, by less than a pixel."""
    touch, press = TouchSensor(size=512), Press(name, 0.9, x_mm)
    shown, surface = Scene(AS_BUILT, CameraResponse()).show(press)
    at = touch.layer.at_mm
    felt = touch.feel(-(object_height(name, at[None, :] - x_mm, at[:, None]) + 0.9))
    off_mm = np.abs(touch.depth_map_mm(felt) - surface.depth_mm)
    assert np.abs(touch.grey(felt) - shown).mean() < mean_grey
    assert off_mm.mean() < mean_mm
    assert off_mm.max() < most_mm


def test_cast_shadows_are_dark_and_can_be_left_out(touch: TouchSensor) -> None:
    felt = touch.feel(gap_of(touch, "TSTEP", 0.9))
    without = TouchSensor(GEOMETRY, cast_shadows=False).grey(felt)
    shadow = without - touch.grey(felt)
    assert shadow.max() > 20
    assert shadow.min() > -1e-3


def test_a_picture_is_the_grey_with_noise_of_its_own(touch: TouchSensor) -> None:
    felt = touch.feel(gap_of(touch, "BALL", 0.5))
    first, second = touch.picture(felt), touch.picture(felt)
    assert first.dtype == np.uint8
    assert first.shape == (120, 160, 3)
    assert np.std(first - second.astype(float)) == pytest.approx(np.sqrt(2 * (1 + 1 / 12)), rel=0.05)
    assert touch.picture(felt, noise=False) == pytest.approx(np.rint(touch.grey(felt)))
    assert (TouchSensor(GEOMETRY).picture(felt) == first).all(), "the same seed draws the same noise"


@pytest.mark.parametrize("force_n", [0.05, 1.0, 5.0])
def test_a_layer_sinks_until_it_carries_a_force(touch: TouchSensor, force_n: float) -> None:
    for height_mm in (-2.0, 0.3):
        felt = touch.sink(gap_of(touch, "BALL", height_mm), force_n)
        assert felt.force_n == pytest.approx(force_n, rel=2e-3)
    assert touch.sink(gap_of(touch, "BALL", 0.3), 0.0).force_n == 0


def beside(touch: TouchSensor) -> np.ndarray:
    return np.where(np.hypot(touch.layer.at_mm[:, None], touch.layer.at_mm) > 25.1, -1.0, NOTHING)


def test_nothing_is_felt_beside_the_gel_and_nothing_carries_nothing(touch: TouchSensor) -> None:
    assert touch.feel(beside(touch)).force_n == touch.sink(beside(touch), 0.0).force_n == 0


@pytest.mark.parametrize(
    ("use", "said"),
    [
        (lambda touch: touch.sink(gap_of(touch, "BALL", 0.1), 100.0), "100 N are too much"),
        (lambda touch: touch.sink(gap_of(touch, "BALL", 0.1), -1.0), "force of -1 N: give 0 or more"),
        (lambda touch: touch.sink(beside(touch), 2.0), "nothing lies before the gel that could press it with 2 N"),
        (lambda touch: touch.feel(np.zeros((3, 3))), r"shape \(3, 3\): give \(128, 128\) finite mm"),
        (lambda touch: touch.feel(np.full((128, 128), np.nan)), "finite"),
        (lambda touch: touch.feel(gap_of(touch, "BALL", 4.0)), "lies 3.98 mm deep in a gel that is simulated to 3 mm"),
        (lambda touch: TouchSensor("my-sensor"), "give a SensorGeometry, or a bundle by"),
        (lambda touch: TouchSensor(size=3), "a grid of 3 points"),
        (lambda touch: TouchSensor(gel={"gel_thickness_mm": 2.0}), "corrects a bundle: give one, or a SensorGeometry"),
        (
            lambda touch: touch.dots_px(touch.feel(beside(touch))),
            r"no dots are printed on this gel: give Touch",
        ),
    ],
)
def test_what_cannot_be_is_refused(touch: TouchSensor, use: Callable[[TouchSensor], object], said: str) -> None:
    with pytest.raises((ValueError, InputError), match=said):
        use(touch)


def test_what_another_sensor_felt_is_refused(touch: TouchSensor) -> None:
    other = TouchSensor(size=64)
    felt = other.feel(gap_of(other, "BALL", 0.5))
    for use in (touch.picture, touch.depth_map_mm, partial(touch.pull, force_n=(0.1, 0.0))):
        with pytest.raises(InputError, match="felt on 64 points a side by another sensor: this one has 128"):
            use(felt)


def test_the_spline_of_the_picture_has_no_weights_that_change_nothing() -> None:
    geometry, at = SensorGeometry(), (np.arange(128) - 63.5) / 2
    splines, depth = Splines(geometry, at), np.random.default_rng(0).random((128, 128), np.float32)
    x, y = pixel_grid(geometry)
    exact = RectBivariateSpline(at, at, depth)(y[:, 0], x[0])
    inside = (slice(100, -100), slice(100, -100))  # which of the two ends is taken shows beyond
    assert np.abs(splines.surface(depth)[0] - exact)[inside].max() < 1e-5
    for weights in filter(lambda one: isinstance(one, np.ndarray), vars(splines).values()):
        assert np.abs(weights[weights != 0]).min() > 1e-13, "denormal numbers are slow"


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return pressed_unit(tmp_path_factory.mktemp("units") / "unit", gel_thickness_mm=3.0)


def pressed(touch: TouchSensor, depth_mm: float) -> np.ndarray:
    at = touch.layer.at_mm
    return -(object_height("BALL", at[None, :], at[:, None]) + depth_mm)


def test_a_bundle_is_a_gel_and_its_camera(bundle: Bundle) -> None:
    touch = TouchSensor(bundle)
    felt = touch.feel(pressed(touch, 0.6))
    assert touch.geometry.gel_thickness_mm == 3.0
    assert np.ptp(felt.at_mm) > 20 + 4 * 3 - 1, "the grid holds the view and a margin around it"
    _, across, down = touch.surface(felt)
    assert (touch.grey(felt) == MeasuredLight.of(bundle).grey(across, down)).all()
    assert touch.light.error_grey is not None
    picture = touch.picture(felt)
    assert (picture.shape, picture.dtype) == ((*SHAPE, 3), np.uint8)
    rest = touch.feel(pressed(touch, -0.1))
    assert touch.grey(rest) == pytest.approx(bundle.reference, abs=1e-3)
    off = picture - touch.grey(felt)
    assert np.std(off) == pytest.approx(np.hypot(NOISE_GREY, np.sqrt(1 / 12)), rel=0.05)


def test_the_same_press_looks_alike_in_the_simulated_sensor(bundle: Bundle) -> None:
    touch = TouchSensor(bundle, size=256, extent_mm=32.0)
    drawn = touch.grey(touch.feel(pressed(touch, 0.6)))
    with open_camera(f"sim://?bundle={bundle.source}&object=BALL&depth=0.6&noise=0") as camera:
        frame = camera.read()
    assert np.abs(frame.image - drawn).mean() < 0.5
    assert np.abs(frame.image - drawn).max() < 3


def test_the_user_may_know_the_gel_better(bundle: Bundle) -> None:
    assert TouchSensor(bundle, gel={"gel_thickness_mm": 2.0}).geometry.gel_thickness_mm == 2.0
    with pytest.raises(InputError, match=r"cannot be simulated: gel_thickness_mm = -1.0 must be greater than 0"):
        TouchSensor(bundle, gel={"gel_thickness_mm": -1.0})
    with pytest.raises(InputError, match="no thickness_mm: did you mean gel_thickness_mm"):
        TouchSensor(bundle, gel={"thickness_mm": 2.0})


# ---- marker dots, against those of `sim://` ----

DOTTED = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=0.1176)
DOTS = PrintedDots(columns=9, rows=7, diameter_mm=1.0, missing=0.1)
FRICTION = 0.6


@pytest.fixture(scope="module")
def dotted() -> TouchSensor:
    return TouchSensor(DOTTED, size=256, dots=DOTS)


def felt_ball(dotted: TouchSensor, depth_mm: float) -> Felt:
    at = dotted.layer.at_mm
    return dotted.feel(-(object_height("BALL", at[None, :], at[:, None]) + depth_mm))


def test_dots_lie_where_the_simulated_sensor_shows_them(dotted: TouchSensor) -> None:
    scene = Scene(DOTTED, CameraResponse(), printed=Printed(dots=DOTS, friction=FRICTION))
    felt, rest = felt_ball(dotted, 0.9), felt_ball(dotted, -0.1)
    shown, shear = scene.show(Press("BALL", 0.9))[0], scene.shear(Press("BALL", 0.9))
    spread = dotted.dots_px(felt) - dotted.dots_px(rest)
    assert np.hypot(*spread.T).max() > 0.4
    assert dotted.dots_px(felt) == pytest.approx(shear.dots_px[DOTS.printed], abs=0.04)
    assert np.abs(dotted.grey(felt) - shown).mean() < 0.2


def test_a_drag_takes_the_dots_along(dotted: TouchSensor) -> None:
    felt = felt_ball(dotted, 0.9)
    still = dotted.dots_px(felt)
    moved = dotted.dots_px(felt, dotted.drag(felt, (0.2, -0.1, 0.0), friction=5.0)) - still
    middle = np.hypot(*(still - (159.5, 119.5)).T).argmin()
    # Dots that stick move with the object, nearer to the camera by 40 / (40 - 0.9).
    assert moved[middle] * DOTTED.pixel_size_mm == pytest.approx((0.2, -0.1), abs=0.02)
    assert np.hypot(*moved.T).min() < 0.1 * np.hypot(*moved[middle])
    assert (
        dotted.picture(felt, dotted.drag(felt, (0.2, -0.1, 0.0)), noise=False) != dotted.picture(felt, noise=False)
    ).any()


def test_dots_darken_a_unit_and_are_found(tmp_path_factory: pytest.TempPathFactory) -> None:
    unit = TouchSensor(pressed_unit(tmp_path_factory.mktemp("dots") / "u"), dots=PrintedDots(columns=4, rows=3))
    found = find_dots(unit.grey(felt_ball(unit, -0.1)))
    assert found.count == 12
