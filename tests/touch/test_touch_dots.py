"""Marker dots in the pictures of a gel that is pressed and dragged, against those of `sim://`."""

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.dots import find_dots
from gellight.lab.simulator.printed_dots import PrintedDots
from gellight.lab.simulator.scene import Press, Printed, Scene
from gellight_touch import Felt, TouchSensor
from sim_reference.camera import CameraResponse
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height
from tests.helpers.pressed_unit import pressed_unit

GEOMETRY = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=0.1176)
DOTS = PrintedDots(columns=9, rows=7, diameter_mm=1.0, missing=0.1)
FRICTION = 0.6


@pytest.fixture(scope="module")
def touch() -> TouchSensor:
    return TouchSensor(GEOMETRY, size=256, dots=DOTS)


def felt_ball(touch: TouchSensor, depth_mm: float) -> Felt:
    at = touch.layer.at_mm
    return touch.feel(-(object_height("BALL", at[None, :], at[:, None]) + depth_mm))


def test_dots_lie_where_the_simulated_sensor_shows_them(touch: TouchSensor) -> None:
    scene = Scene(GEOMETRY, CameraResponse(), printed=Printed(dots=DOTS, friction=FRICTION))
    felt, rest = felt_ball(touch, 0.9), felt_ball(touch, -0.1)
    shown, shear = scene.show(Press("BALL", 0.9))[0], scene.shear(Press("BALL", 0.9))
    spread = touch.dots_px(felt) - touch.dots_px(rest)
    assert np.hypot(*spread.T).max() > 0.4
    assert touch.dots_px(felt) == pytest.approx(shear.dots_px[DOTS.printed], abs=0.04)
    assert np.abs(touch.grey(felt) - shown).mean() < 0.2


def test_a_drag_takes_the_dots_along(touch: TouchSensor) -> None:
    felt = felt_ball(touch, 0.9)
    still = touch.dots_px(felt)
    moved = touch.dots_px(felt, touch.drag(felt, (0.2, -0.1, 0.0), friction=5.0)) - still
    middle = np.hypot(*(still - (159.5, 119.5)).T).argmin()
    # Dots that stick move with the object, nearer to the camera by 40 / (40 - 0.9).
    assert moved[middle] * GEOMETRY.pixel_size_mm == pytest.approx((0.2, -0.1), abs=0.02)
    assert np.hypot(*moved.T).min() < 0.1 * np.hypot(*moved[middle])
    assert (
        touch.picture(felt, touch.drag(felt, (0.2, -0.1, 0.0)), noise=False) != touch.picture(felt, noise=False)
    ).any()


def test_dots_darken_a_unit_and_are_found(tmp_path_factory: pytest.TempPathFactory) -> None:
    unit = TouchSensor(pressed_unit(tmp_path_factory.mktemp("dots") / "u"), dots=PrintedDots(columns=4, rows=3))
    found = find_dots(unit.grey(felt_ball(unit, -0.1)))
    assert found.count == 12


def test_a_gel_without_dots_says_so() -> None:
    plain = TouchSensor(GEOMETRY, size=64)
    with pytest.raises(InputError, match=r"no dots are printed on this gel: give TouchSensor\(dots="):
        plain.dots_px(felt_ball(plain, 0.5))
