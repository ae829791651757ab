"""A flat end between walls that are steeper than any press of the ball is felt as deep as it is."""

from pathlib import Path

import numpy as np
import pytest

from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.simulator.scene import Press as Pressed
from gellight.lab.simulator.scene import Scene
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.training import fit, read_reference
from gellight.lab.training.validation import frame_of
from sim_reference.camera import CameraResponse
from tests.helpers.pressed_pictures import GEOMETRY, photograph

BALL = Ball(radius_mm=4, pixel_size_mm=GEOMETRY.pixel_size_mm)


@pytest.fixture(scope="module")
def felt(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Path, Reconstructor]:
    """A bundle of ten presses of .4 to 1 mm, whose steepest slope is 0.67."""
    folder, random = tmp_path_factory.mktemp("presses"), np.random.default_rng(2)
    scene = Scene(GEOMETRY, CameraResponse())
    photograph(scene, None, 0, folder / "untouched.png")
    presses = []
    for number in range(10):
        x, y = random.uniform([-12, -9], [12, 9])
        pressed = Pressed("BALL", random.uniform(0.4, 1.0), x, y)
        contact = photograph(scene, pressed, number + 1, folder / f"{number}.png")
        x_px, y_px = x / GEOMETRY.pixel_size_mm + 79.5, y / GEOMETRY.pixel_size_mm + 59.5
        radius_px, path = float(np.sqrt(contact.sum() / np.pi)), folder / f"{number}.png"
        presses.append(Press(image=path, center_x_px=x_px, center_y_px=y_px, contact_radius_px=radius_px))
    bundle = fit(presses, read_reference(folder / "untouched.png"), BALL, folder / "bundle", sensor="walls")
    return scene, folder, Reconstructor(bundle)


@pytest.mark.parametrize(("depth_mm", "least_mm"), [(0.3, 0.29), (0.6, 0.57), (1.0, 0.95)])
def test_a_flat_end_between_upright_walls_is_felt_as_deep_as_it_is(
    felt: tuple[Scene, Path, Reconstructor], depth_mm: float, least_mm: float
) -> None:
    """Where the network learnt the slopes of the presses alone: 0.294, 0.553, 0.830 mm."""
    scene, folder, path = felt
    contact = photograph(scene, Pressed("CYLINDER", depth_mm), 99, folder / "cylinder.png")
    frame = frame_of(Press(image=folder / "cylinder.png", center_x_px=80, center_y_px=60, contact_radius_px=5))
    middle = contact & (np.hypot(*(np.indices(contact.shape) - np.array([59.5, 79.5])[:, None, None])) < 8)
    assert least_mm < float(path.reconstruct(frame).depth_mm[middle].mean()) < 1.04 * depth_mm
