"""A real unit as `sim://`: the light that its presses measured."""

from pathlib import Path

import numpy as np
import pytest

import gellight
from gellight.base.errors import BundleError, CameraError, InputError
from gellight.bundle.bundle import Bundle, load_bundle, write_bundle
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View
from gellight.lab.simulator.measured_light import MeasuredLight
from gellight.lab.simulator.unit import Unit
from gellight.lab.training.presses import contact_circle, sphere_gradient
from gellight.lab.training.table import TableOptions, build_table
from gellight.opening import open_camera
from gellight.reconstruction.light_drift import difference_of
from tests.benchmarks.real_sets import three_lights_crop
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.pressed_unit import NOISE_GREY, PIXEL_MM, SHAPE, press_rows, pressed_unit, true_change

Y, X = np.indices(SHAPE, dtype=np.float64)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return pressed_unit(tmp_path_factory.mktemp("units") / "unit", camera={"exposure_us": 4000, "width": 80})


def test_slopes_have_the_colours_that_the_presses_showed(bundle: Bundle) -> None:
    light = MeasuredLight.of(bundle)
    random = np.random.default_rng(1)
    for _ in range(3):
        across, down = np.full(SHAPE, random.uniform(-0.6, 0.6)), np.full(SHAPE, random.uniform(-0.6, 0.6))
        off = light.grey(across, down) - bundle.reference - true_change(across, down, X, Y)
        assert np.abs(off).mean() < 0.3
        assert off[8:-8, 8:-8] == pytest.approx(0, abs=1.5), "up to the ridge, where presses were"
    flat = np.zeros(SHAPE)
    assert (light.grey(flat, flat) == bundle.reference).all(), "the gel at rest is the picture of it"
    assert light.error_grey == pytest.approx(0, abs=0.3)


def test_the_error_is_that_of_presses_left_out(tmp_path: Path) -> None:
    noisy = MeasuredLight.of(pressed_unit(tmp_path / "noisy", noise_grey=5.0))
    assert noisy.error_grey == pytest.approx(5.0 * np.sqrt(2 / np.pi), rel=0.05)
    assert MeasuredLight.of(pressed_unit(tmp_path / "one", presses=1)).error_grey is None


def test_a_wall_and_a_corner_that_no_press_showed_are_not_extrapolated(tmp_path: Path) -> None:
    rows = press_rows((40.0, 30.0), np.random.default_rng(0))
    light = MeasuredLight.of(pressed_unit(tmp_path / "u", presses=1, rows=rows))
    steepest, flat = light.steepest / np.sqrt(1 - light.steepest**2), np.zeros(SHAPE)
    assert light.steepest == pytest.approx(0.8, abs=0.03)
    assert light.grey(flat + 50, flat) == pytest.approx(light.grey(flat + steepest, flat), abs=0.5)
    drawn = light.grey(flat + 0.3, flat) - light.reference
    assert drawn[0, 0] == pytest.approx(drawn[22, 32], abs=1e-3)


def test_a_bundle_without_pressed_pictures_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"has no presses.npz: calibrate the sensor again to record presses"):
        MeasuredLight.of(linear_bundle(tmp_path / "bare"))
    lights = pressed_unit(tmp_path / "lights", rows=np.zeros((5, 10), np.float32))
    with pytest.raises(BundleError, match=r"several lights one after the other: give a bundle of single pictures"):
        MeasuredLight.of(lights)
    oblong = pressed_unit(tmp_path / "oblong", pixel_size_mm=(0.2, 0.1))
    with pytest.raises(BundleError, match=r"pixels of 0.2 x 0.1 mm, only square ones"):
        Unit(oblong).geometry()


def test_the_gel_is_that_of_the_bundle_unless_the_user_knows_better(bundle: Bundle, tmp_path: Path) -> None:
    plain = Unit(bundle).geometry()
    assert (plain.image_shape, plain.pixel_size_mm, plain.gel_thickness_mm) == (SHAPE, PIXEL_MM, 5.0)
    assert plain.gel_diameter_mm == pytest.approx(20.0)
    thin = pressed_unit(tmp_path / "thin", gel_thickness_mm=2.0)
    assert Unit(thin).geometry().gel_thickness_mm == 2.0
    assert Unit(thin).geometry({"gel_thickness_mm": 3.0, "image_width_px": 640}).gel_thickness_mm == 3.0
    weighed = bundle.with_files({"force.json": load_bundle("synthetic").files["force.json"]})
    assert Unit(weighed).youngs_modulus_mpa == pytest.approx(0.2)
    with pytest.raises(InputError, match=r"cannot be simulated: poisson_ratio = 0.5"):
        open_camera(f"sim://?bundle={bundle.source}", geometry={"poisson_ratio": 0.5})


def test_the_camera_shows_the_unit_as_it_was_calibrated(bundle: Bundle) -> None:
    with open_camera(f"sim://?bundle={bundle.source}&object=BALL&depth=0.6&fps=200", bundle=bundle) as camera:
        frame = camera.read()
        assert camera.controls.read("exposure_us") == 4000
        with pytest.raises(CameraError, match=r"exposure_us = 8000: .* as it was calibrated, with 4000"):
            camera.controls.set("exposure_us", 8000)
    right = bundle.reference + true_change(*np.moveaxis(frame.truth.gradient_map, 2, 0), X, Y)
    off = frame.image - right
    assert np.abs(off).mean() == pytest.approx(NOISE_GREY * np.sqrt(2 / np.pi), abs=0.1)
    assert frame.light is None


def test_a_sensor_that_is_drawn_runs_with_its_own_bundle(bundle: Bundle) -> None:
    with gellight.connect(f"sim://?bundle={bundle.source}&object=BALL&depth=0.6&fps=50") as sensor:
        frame = sensor.next_frame()
    assert frame.camera_frame.image.shape == (*SHAPE, 3)
    assert frame.contact.indentation_mm == pytest.approx(0.6, rel=0.3)


def test_pictures_are_drawn_as_they_are_after_the_view_was_taken(tmp_path: Path) -> None:
    view = View.of_corners([(10, 10), (150, 14), (146, 110), (12, 100)], (120, 160), SHAPE)
    seen = pressed_unit(tmp_path / "seen", extra_files=PictureSteps.with_view(view).files())
    with open_camera(f"sim://?bundle={seen.source}&object=BALL&depth=0.5", bundle=seen) as camera:
        assert camera.read().image.shape == (*SHAPE, 3)
    with gellight.connect(f"sim://?bundle={seen.source}&object=BALL&depth=0.5&fps=50") as sensor:
        assert sensor.next_frame().camera_frame.image.shape == (*SHAPE, 3)


@pytest.mark.parametrize("parameter", ["board=1", "led_spread=0.05", "crosstalk=0.2", "dim=0.1"])
def test_simulated_light_and_measured_light_exclude_each_other(bundle: Bundle, parameter: str) -> None:
    name = parameter.partition("=")[0]
    with pytest.raises(InputError, match=rf"measured on a real unit: leave out {name}"):
        open_camera(f"sim://?bundle={bundle.source}&{parameter}")


def test_a_real_press_that_was_left_out_is_drawn(tmp_path: Path) -> None:
    images = three_lights_crop(tmp_path)
    reference, ball = images.reference.image, images.ball
    table = build_table(images.presses[1:], reference, ball, TableOptions(), follow_light=True)
    unit = write_bundle(
        tmp_path / "unit", sensor="crop", reference=reference, reference_frames=1, noise_grey=1.0, metrics={},
        pixel_size_mm=(ball.pixel_size_mm,) * 2, network=b"none", presses=table.arrays(),
    )  # fmt: skip
    press = images.presses[0]
    shape, change = images.reference.image_shape, difference_of(press.picture(), reference, follow_light=True)
    light, inside = MeasuredLight.of(unit), contact_circle(press, shape)
    drawn = light.grey(*np.moveaxis(np.nan_to_num(sphere_gradient(press, ball, shape)), 2, 0)) - reference
    assert np.abs(change[inside]).mean() > 20
    assert np.abs(drawn - change)[inside].mean() < 4
    assert light.error_grey < 3.5
