"""Dots on the simulated gel: where they are printed, how a press and a drag move them, and what the truth says."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.simulator.dragging import sheared
from gellight.lab.simulator.printed_dots import PrintedDots, known_force, seen_px
from gellight.lab.simulator.scene import Press, Printed, Scene
from gellight.lab.simulator.simulated_camera import open_simulated
from gellight.lab.simulator.stage import Stage
from gellight.reconstruction.force_file import ForceRecord
from sim_reference.camera import CameraResponse
from sim_reference.deformation import Deformation
from sim_reference.geometry import SensorGeometry
from tests.helpers.dotted import centres_of

GEOMETRY = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=0.1176)
DOTS = PrintedDots(columns=9, rows=7, diameter_mm=0.8)
FRICTION = 0.6


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(GEOMETRY, CameraResponse(noise_grey=0.0), printed=Printed(dots=DOTS, friction=FRICTION))


@pytest.fixture(scope="module")
def slid(scene: Scene) -> Press:
    """Far enough that nothing sticks."""
    return Press("BALL", 1.0, 2.0, 1.0, tuple((step, 0.0, 0.0) for step in (0.5, 1.0, 1.6)))


@pytest.mark.parametrize("path", [None, (), ((0.3, 0.2, 0.0),), ((0.0, 0.0, 0.2),), ((1.6, 0.0, 0.0),)])
def test_dots_are_seen_where_the_truth_says(scene: Scene, path: tuple[tuple[float, float, float], ...] | None) -> None:
    press = None if path is None else Press("BALL", 1.0, 2.0, 1.0, path)
    grey, _ = scene.show(press)
    truth = scene.shear(press)
    found = centres_of(grey, truth.dots_px, 0.8 / GEOMETRY.pixel_size_mm)
    # The shading at the rim of a contact pulls the centroid of a dot that lies there.
    assert np.percentile(np.hypot(*(found - truth.dots_px).T), 95) < 0.1
    assert np.abs(found - truth.dots_px).max() < 0.15


def test_what_lies_deep_is_seen_farther_from_the_middle() -> None:
    # x H / (H - d): 10 mm off the axis and 1 mm deep, 40 mm from the camera, 10 / 39 mm farther out.
    at_rest, pressed = (seen_px(np.array([[10.0, 0.0]]), np.array([depth]), GEOMETRY) for depth in (0.0, 1.0))
    assert (pressed - at_rest)[0, 0] * GEOMETRY.pixel_size_mm == pytest.approx(10 / 39)
    assert (pressed - at_rest)[0, 1] == 0


def test_an_object_that_slides_pulls_with_all_of_its_friction(scene: Scene, slid: Press) -> None:
    truth = scene.shear(slid)
    record = ForceRecord.model_validate_json(known_force(GEOMETRY)["force.json"])
    pressed = scene.deformation(slid)
    modulus = record.youngs_modulus_mpa / (2 * (1 + GEOMETRY.poisson_ratio))
    normal_n = pressed.pressure.sum() * pressed.spacing_mm**2 * modulus
    assert truth.force_n[0] == pytest.approx(FRICTION * normal_n, rel=1e-3)
    assert abs(truth.force_n[1]) < 1e-6
    assert truth.sticking_share == 0
    assert not truth.sticks.any()


def test_a_small_drag_sticks_in_the_middle_and_carries_its_dots(scene: Scene) -> None:
    truth = scene.shear(Press("BALL", 1.0, 2.0, 0.0, ((0.2, 0.0, 0.0),)))
    assert 0.5 < truth.sticking_share < 0.95
    under = np.hypot(*(DOTS.places_mm - [2.0, 0.0]).T).argmin()
    assert truth.dots_mm[under, 0] == pytest.approx(0.2, abs=0.005)
    far = np.abs(DOTS.places_mm - [2.0, 0.0]).max(axis=1) > 8
    assert np.abs(truth.dots_mm[far]).max() < 0.03
    row, column = np.rint(seen_px(DOTS.places_mm[[under]], np.zeros(1), GEOMETRY))[0, ::-1].astype(int)
    assert truth.field_mm[row, column, 0] == pytest.approx(0.2, abs=0.005)
    assert truth.sticks[row, column]


def test_going_back_over_the_same_path_does_not_undo_what_slipped(scene: Scene, slid: Press) -> None:
    back = Press("BALL", 1.0, 2.0, 1.0, (*slid.path, (1.0, 0.0, 0.0)))
    here, before = scene.shear(back), scene.shear(Press("BALL", 1.0, 2.0, 1.0, slid.path[:2]))
    assert here.force_n[0] < 0.5 * before.force_n[0]


def test_the_grid_of_what_presses_nothing_lies_about_the_middle() -> None:
    """Four thicknesses to each side of the point behind the middle, 0.2 mm apart."""
    flat = Deformation(depth_mm=np.zeros((128, 128)), pressure=np.zeros((128, 128)), spacing_mm=0.1)
    found = sheared(flat, replace(GEOMETRY, gel_thickness_mm=1.0), FRICTION, ())
    assert found.corner_mm == pytest.approx([-3.9, -3.9])
    assert 41 <= len(found.pressure) <= 45
    assert (found.force(), found.sticking_share) == ((0.0, 0.0, 0.0), 0.0)


def test_the_imprint_goes_with_the_object_and_turns_with_it() -> None:
    plain = Scene(GEOMETRY, CameraResponse(noise_grey=0.0))
    moved = plain.show(Press("TSTEP", 0.5, 0.0, 0.0, ((1.0, 0.5, 0.0),)))[1]
    placed = plain.show(Press("TSTEP", 0.5, 1.0, 0.5))[1]
    np.testing.assert_array_equal(moved.depth_mm, placed.depth_mm)
    turned = plain.show(Press("TSTEP", 0.5, 0.0, 0.0, ((0.0, 0.0, 0.3),)))[1]
    by_x, by_y = (np.gradient(turned.depth_mm.astype(float), GEOMETRY.pixel_size_mm, axis=axis) for axis in (1, 0))
    smooth = np.hypot(*np.moveaxis(turned.gradient_map, 2, 0)) < 0.05
    assert np.abs(turned.gradient_map[..., 0] - by_x)[smooth].mean() < 0.003
    assert np.abs(turned.gradient_map[..., 1] - by_y)[smooth].mean() < 0.003
    still = plain.show(Press("TSTEP", 0.5))[1]
    assert turned.contact.sum() == pytest.approx(still.contact.sum(), rel=0.03)
    assert (turned.contact ^ still.contact).sum() > 0.05 * still.contact.sum()
    assert plain.shear(None) is None


def test_dots_come_off_as_the_url_says() -> None:
    with open_simulated("sim://?board=0&programme=0&dots=9x7&dots_missing=0.2&noise=0") as camera:
        frame = camera.read()
        places = np.rint(frame.truth.shear.dots_px).astype(int)
        grey = frame.image[places[:, 1], places[:, 0]].max(axis=1)
    assert (grey < 80).sum() == 63 - 13


def test_a_drag_needs_something_that_is_pressed_and_stays_on_the_gel() -> None:
    stage = Stage(GEOMETRY, programme=False)
    with pytest.raises(InputError, match="nothing is pressed"):
        stage.drag(0.1, 0.0)
    stage.press("BALL", 1.0, 0.0, 0.0)
    with pytest.raises(InputError, match="off the gel"):
        stage.drag(30.0, 0.0)
    with pytest.raises(InputError, match="turn"):
        stage.drag(0.0, 0.0, 1.0)
    stage.drag(0.5, 0.0)
    assert stage.status()["x_mm"] == 0.5
