"""Normals where lights are near, few, or dark."""

import numpy as np
import pytest

from sim_reference.imaging import normals
from sim_reference.metrics import angular_error
from sim_reference.photometric_stereo import ring_directions, solve_normals


def cap(steepest_rad: float, size: int = 81) -> np.ndarray:
    """Gradient map of a sphere's top whose slope at the middle of its border is `steepest_rad`."""
    at = np.linspace(-1, 1, size) * np.sin(steepest_rad) / np.sqrt(2)
    x, y = at[None, :], at[:, None]
    height = np.sqrt(1 - x**2 - y**2)
    return np.stack([-x / height, -y / height], axis=2)


def test_pixels_with_fewer_than_three_lights_keep_all_and_darkness_faces_the_camera() -> None:
    lights = ring_directions(4, 0.5)
    dim = np.array([0.0, 0.0, 0.3, 0.4])[:, None, None] * np.ones((4, 1, 1))
    assert solve_normals(dim, lights, shadow_level=0.1) == pytest.approx(solve_normals(dim, lights))
    assert solve_normals(np.zeros((4, 2, 2)), lights, shadow_level=0.1)[0, 0] == pytest.approx([0, 0, 1])


@pytest.mark.parametrize("shadow_level", [None, 1e-9])
def test_near_lights_are_solved_pixel_by_pixel(shadow_level: float | None) -> None:
    gradient = cap(np.radians(30), 21)
    rng = np.random.default_rng(6)
    lights = ring_directions(6, 0.5)[:, None, None, :] + rng.normal(0, 0.1, (6, 21, 21, 3))
    images = np.maximum((lights * normals(gradient)).sum(axis=3), 0)
    assert images.min() > 0
    error = angular_error(solve_normals(images, lights, shadow_level), normals(gradient))
    assert np.degrees(error.max()) < 1e-9
