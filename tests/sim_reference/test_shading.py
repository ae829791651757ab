"""One LED on tilted, stepped and bumpy gel, and the trends of the paper over the mounting height."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from sim_reference.geometry import SensorGeometry, led_axes, led_positions, pixel_grid
from sim_reference.imaging import led_irradiance, normals, ring_irradiance, ring_light, visibility
from sim_reference.metrics import normalised_deviation, saturation
from sim_reference.surface import Surface, untouched

SMALL = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=0.235)


def plane(gx: float, gy: float) -> Surface:
    x, y = pixel_grid(SMALL)
    gradient = np.broadcast_to(np.array([gx, gy]), (*SMALL.image_shape, 2))
    return Surface(gx * x + gy * y, gradient, np.zeros(SMALL.image_shape, bool))


def axes() -> tuple[np.ndarray, np.ndarray]:
    x, y = pixel_grid(SMALL)
    return x.ravel(), y.ravel()


def test_a_lambertian_lamp_that_looks_down_lights_a_plane_with_the_fourth_power_of_the_cosine() -> None:
    down = replace(SMALL, incident_angle_rad=0.0)
    x, y = pixel_grid(down)
    position = led_positions(down)[1]
    cosine = position[2] / np.sqrt((x - position[0]) ** 2 + (y - position[1]) ** 2 + position[2] ** 2)
    assert led_irradiance(untouched(down), down, 1) == pytest.approx(cosine**4, rel=1e-12)


@pytest.mark.parametrize("led", [0, 3, 7])
def test_a_tilted_plane_obeys_equation_3(led: int) -> None:
    surface = plane(0.1, -0.2)
    row, column = 31, 117
    x, y = axes()
    point = np.array([x[column], y[row], surface.depth_mm[row, column]])
    to_led = led_positions(SMALL)[led] - point
    distance = np.linalg.norm(to_led)
    light = to_led / distance
    normal = np.array([-0.1, 0.2, 1]) / np.sqrt(1.05)
    expected = (-light @ led_axes(SMALL)[led]) * (normal @ light) * (20 / distance) ** 2
    assert led_irradiance(surface, SMALL, led)[row, column] == pytest.approx(expected, rel=1e-12)


def test_a_narrow_beam_is_a_power_of_a_wide_one() -> None:
    narrow = replace(SMALL, beam_angle_rad=2 * np.arccos(0.5 ** (1 / 3)))
    flat = untouched(SMALL)
    x, y = pixel_grid(SMALL)
    to_led = led_positions(SMALL)[2] - np.stack(np.broadcast_arrays(x, y, 0 * x), axis=2)
    leaving = -(to_led @ led_axes(SMALL)[2]) / np.linalg.norm(to_led, axis=2)
    expected = led_irradiance(flat, SMALL, 2) * leaving**2
    assert led_irradiance(flat, narrow, 2) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("height", [0.5, 1.0, 2.0])
def test_the_shadow_of_a_step_is_as_long_as_similar_triangles_say(height: float) -> None:
    x = (np.arange(800) - 399.5) * 0.025
    y = (np.arange(41) - 20) * 0.025
    led = np.array([21.5, 0.0, 20.0])
    step = np.where(x > 0, height, 0.0) * np.ones((41, 1))
    seen = visibility(step, (x, y), led)[20]
    assert (seen[x > 0.05] == 1).all()
    shadow = (1 - seen).sum() * 0.025
    assert shadow == pytest.approx(21.5 * height / (20 - height), abs=0.06)  # 1.2 pitches of the polar grid


def test_cast_shadows_darken_the_far_side_of_a_bump_only() -> None:
    x, y = pixel_grid(SMALL)
    depth = 3.0 * np.exp(-(x**2 + y**2) / 1.5)
    gradient = np.stack([-2 * x / 1.5 * depth, -2 * y / 1.5 * depth], axis=2)
    bump = Surface(depth, gradient, depth > 1)
    lit = led_irradiance(bump, SMALL, 0)  # from the right
    flat = led_irradiance(untouched(SMALL), SMALL, 0)
    middle = slice(58, 62)
    assert lit[middle, (x > -5).ravel() & (x < -4).ravel()].max() > 0.9 * flat.min()
    assert lit[middle, (x > -2.6).ravel() & (x < -2.2).ravel()].max() < 0.05 * flat[60, 60]
    assert lit[:, x.ravel() > 6] == pytest.approx(flat[:, x.ravel() > 6], rel=0.01)


def test_lights_nearer_to_the_gel_make_it_more_colourful_and_less_even() -> None:
    """Section 2.3.2: the trends of figure 4e over the mounting height."""
    pictures = []
    for height in np.arange(0, 37, 4.0):
        geometry = replace(SMALL, mounting_height_mm=height)
        pictures.append(ring_irradiance(untouched(geometry), geometry, ring_light(geometry)))
    assert np.all(np.diff([saturation(picture) for picture in pictures]) > 0)
    assert np.all(np.diff([normalised_deviation(picture) for picture in pictures]) > 0)


def without_shadows(surface: Surface, geometry: SensorGeometry, led: int) -> np.ndarray:
    """Equation 3 as a product of vectors, attached shadow included, cast shadow not."""
    x, y = pixel_grid(geometry)
    to_led = led_positions(geometry)[led] - np.stack(np.broadcast_arrays(x, y, surface.depth_mm), axis=2)
    distance = np.linalg.norm(to_led, axis=2)
    facing = (normals(surface.gradient_map) * to_led).sum(axis=2) / distance
    leaving = -(to_led @ led_axes(geometry)[led]) / distance
    return np.asarray(np.maximum(leaving, 0) * np.maximum(facing, 0) * (20 / distance) ** 2)


@pytest.mark.parametrize("led", [1, 5, 8])
def test_looking_for_shadows_only_where_they_can_fall_finds_them_all(led: int) -> None:
    fine = replace(SMALL, image_width_px=200, image_height_px=160, pixel_size_mm=0.1)
    x, y = pixel_grid(fine)
    depth, gradient = np.zeros(fine.image_shape), np.zeros((*fine.image_shape, 2))
    for height, cx, cy in ((2.5, 3.0, 0.0), (2.0, -4.0, 3.0)):
        bump = height * np.exp(-((x - cx) ** 2 + (y - cy) ** 2))
        depth += bump
        gradient -= 2 * np.stack([(x - cx) * bump, (y - cy) * bump], axis=2)
    surface = Surface(depth, gradient, depth > 1)
    seen_share = visibility(depth, (x.ravel(), y.ravel()), led_positions(fine)[led])
    full = without_shadows(surface, fine, led) * seen_share
    # The two polar grids differ, so do the pixels of partial visibility and their neighbours.
    edge = binary_dilation((seen_share > 0) & (seen_share < 1), iterations=2)
    assert ((seen_share == 0) & ~edge).sum() > 100
    np.testing.assert_allclose(led_irradiance(surface, fine, led)[~edge], full[~edge], rtol=0, atol=1e-9)
