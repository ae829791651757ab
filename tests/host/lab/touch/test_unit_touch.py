"""A calibrated unit in a robot simulator: its gel, drawn by the light that its presses measured."""

import numpy as np
import pytest

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.lab.simulator.measured_light import MeasuredLight
from gellight.lab.touch import TouchSensor
from gellight.opening import open_camera
from sim_reference.objects import object_height
from tests.helpers.pressed_unit import NOISE_GREY, SHAPE, pressed_unit


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
    assert touch.light is not None
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
    with pytest.raises(InputError, match="corrects a bundle: give one, or a SensorGeometry"):
        TouchSensor(gel={"gel_thickness_mm": 2.0})
    with pytest.raises(InputError, match="no thickness_mm: did you mean gel_thickness_mm"):
        TouchSensor(bundle, gel={"thickness_mm": 2.0})


def test_a_bundle_that_keeps_no_presses_is_refused() -> None:
    with pytest.raises(BundleError, match=r"has no presses.npz: calibrate the sensor again to record presses"):
        TouchSensor(load_bundle("synthetic"))
