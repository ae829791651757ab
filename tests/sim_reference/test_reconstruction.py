"""The reference's own inverse: photometric stereo, integration, metrics."""

from collections.abc import Callable
from math import degrees, radians

import numpy as np
import pytest

from sim_reference.imaging import directional_image, normals
from sim_reference.integration import integrate
from sim_reference.metrics import (
    angular_error,
    intensity_deviation,
    maximum_elevation,
    mean_angular_error,
    mean_of_largest,
    normalised_deviation,
    saturation,
)
from sim_reference.photometric_stereo import ring_directions, solve_normals


def gentle_slopes() -> np.ndarray:
    """At most 21 degrees: lights up to 61 degrees from the normal throw no shadow."""
    y, x = np.mgrid[-1:1:40j, -1:1:50j]
    return 0.27 * np.stack([np.sin(3 * x) * np.cos(2 * y), np.cos(4 * y + x)], axis=2)


@pytest.mark.parametrize("count", [3, 12, 21])
@pytest.mark.parametrize("angle_deg", [5, 29, 61])
def test_without_noise_and_shadow_photometric_stereo_is_exact(count: int, angle_deg: float) -> None:
    slopes = gentle_slopes()
    directions = ring_directions(count, radians(angle_deg))
    images = np.array([directional_image(slopes, direction, albedo=230.0) for direction in directions])
    assert degrees(angular_error(solve_normals(images, directions), normals(slopes)).max()) < 1e-9


def test_dropping_shadows_makes_steep_slopes_exact_again() -> None:
    slopes = np.array([[[1.3, 0.2]]])
    directions = ring_directions(12, radians(45))
    images = np.array([directional_image(slopes, d, albedo=230.0) for d in directions])
    assert (images == 0).any(), "some lights must be behind the slope"
    plain = angular_error(solve_normals(images, directions), normals(slopes)).max()
    aware = angular_error(solve_normals(images, directions, shadow_level=1e-9), normals(slopes)).max()
    assert degrees(plain) > 1
    assert degrees(aware) < 1e-9


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: solve_normals(np.zeros((2, 4, 4)), np.zeros((2, 3))), "at least 3"),
        (lambda: ring_directions(2, 0.5), "at least 3"),
        (lambda: integrate(np.zeros((5, 5)), 0.1), r"\(H, W, 2\)"),
        (lambda: saturation(np.zeros((2, 2, 3))), "black"),
        *((lambda share=share: mean_of_largest([1.0], share), "share") for share in (0.0, 1.0, np.nan)),
        *((lambda depth=depth: maximum_elevation(4.0, depth), "radius") for depth in (0.0, -1.0, 4.1, np.nan)),
    ],
)
def test_what_cannot_be_computed_is_refused(call: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        call()


def test_the_integral_converges_with_the_square_of_the_pixel() -> None:
    def error(count: int) -> float:
        at = (np.arange(count) + 0.5) / count * 4 - 2
        x, y = at[None, :], at[:, None]
        bump = np.exp(-(x**2) - y**2)
        difference = integrate(np.stack([-2 * x * bump, -2 * y * bump], axis=2), 4 / count) - bump
        return float(np.abs(difference - np.median(difference)).max())

    assert error(40) / error(80) == pytest.approx(4, rel=0.15)


def test_angles_are_right_from_tiny_to_opposite() -> None:
    for angle in (0.0, 1e-9, 1e-3, 1.0, 3.0, np.pi):
        turned = [np.sin(angle), 0, np.cos(angle)]
        assert angular_error([0, 0, 2.0], turned) == pytest.approx(angle, rel=1e-9, abs=1e-15)
    assert mean_angular_error([[0, 0, 1], [0, 1, 0]], [[0, 0, 1], [0, 0, 1]]) == pytest.approx(np.pi / 4)


def test_the_measures_of_maps_that_are_known() -> None:
    assert mean_of_largest(np.full((10, 10), 0.7), 0.01) == pytest.approx(0.7)
    assert mean_of_largest(np.arange(1000.0), 0.01) == pytest.approx(np.arange(990, 1000).mean())
    assert saturation(np.full((2, 2, 3), 0.4)) == 0
    assert saturation(np.array([[[1.0, 0.0, 0.0], [0.0, 0.5, 0.0]]])) == 1
    picture = np.array([[[1.0, 1.0, 1.0], [3.0, 1.0, 1.0]]])
    assert intensity_deviation(picture) == pytest.approx(1.0), "channels add up"
    assert normalised_deviation(picture) == pytest.approx(1.0 / picture.mean())


@pytest.mark.parametrize(("radius", "degrees"), [(2.5, 78.463), (3, 70.529), (4, 60), (5, 53.130), (8, 41.410)])
def test_a_smaller_ball_records_steeper_slopes(radius: float, degrees: float) -> None:
    assert np.degrees(maximum_elevation(radius, 2.0)) == pytest.approx(degrees, abs=1e-3)


@pytest.mark.parametrize("pixel", [0.1, (0.1, 0.25)])
def test_a_quadratic_surface_is_exact(pixel: float | tuple[float, float]) -> None:
    size_x, size_y = np.broadcast_to(pixel, 2)
    x, y = np.arange(23)[None, :] * size_x, np.arange(17)[:, None] * size_y
    depth = 0.3 * x - 0.2 * y + 0.5 * x**2 - 0.1 * y**2 + 0.4 * x * y
    gradient = np.stack([0.3 + x + 0.4 * y, -0.2 - 0.2 * y + 0.4 * x], axis=2)
    assert integrate(gradient, pixel) == pytest.approx(depth - np.median(depth), abs=1e-9)


def test_noise_is_spread_and_not_summed() -> None:
    noise = np.random.default_rng(3).normal(0, 0.1, (64, 64, 2))
    assert integrate(noise, 1.0).std() < 0.15  # summing along rows would give 0.1 sqrt(32) = 0.57


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
