"""Geometry and pixels, light on the gel (flat, tilted, stepped, bumpy; shadows), and from light to grey levels."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import cos, radians, sin, tan

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, map_coordinates

from sim_reference.camera import CameraResponse, digitise, expose, exposure_for, linear_grey
from sim_reference.geometry import SensorGeometry, led_axes, led_positions, pixel_grid
from sim_reference.imaging import directional_image, led_irradiance, normals, ring_irradiance, ring_light, visibility
from sim_reference.surface import Surface, press_object, sample, untouched

GEOMETRY = SensorGeometry()
SMALL = replace(GEOMETRY, image_width_px=160, image_height_px=120, pixel_size_mm=0.2352)
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def test_the_ring_is_where_the_paper_puts_it() -> None:
    position, axis = led_positions(GEOMETRY), led_axes(GEOMETRY)
    assert position[:, 2] == pytest.approx(20.0)
    assert np.hypot(position[:, 0], position[:, 1]) == pytest.approx(21.5)
    assert position[3] == pytest.approx([0, -21.5, 20])  # azimuth 90 degrees is up in the image
    assert axis[:, 2] == pytest.approx(-cos(radians(29)))
    assert (position[:, :2] * axis[:, :2]).sum(axis=1) == pytest.approx(-21.5 * sin(radians(29)))
    assert ring_light(GEOMETRY)[[0, 4, 8]] == pytest.approx(np.eye(3))


def test_a_slope_is_as_bright_as_lambert_says_and_dark_where_it_turns_away() -> None:
    direction = np.array([sin(radians(30)), 0, cos(radians(30))])
    slopes = np.array([[[tan(radians(tilt)), 0.0] for tilt in (-10, 0, 10, 61)]])
    expected = [*(cos(radians(angle)) for angle in (20, 30, 40)), 0]
    assert directional_image(slopes, direction)[0] == pytest.approx(expected)


def test_the_picture_has_the_symmetry_of_the_ring() -> None:
    # Mirrored left to right, the 12 LEDs are the same ring, numbered the other way round.
    flat = untouched(SMALL)
    for led, twin in ((0, 6), (1, 5), (2, 4), (10, 8)):
        assert led_irradiance(flat, SMALL, led)[:, ::-1] == pytest.approx(led_irradiance(flat, SMALL, twin), rel=1e-9)


def test_dark_leds_give_no_light_and_channels_do_not_mix() -> None:
    flat = untouched(SMALL)
    light = np.zeros((12, 3))
    light[4] = (0.0, 0.5, 0.0)
    picture = ring_irradiance(flat, SMALL, light)
    assert not picture[..., [0, 2]].any()
    assert picture[..., 1] == pytest.approx(0.5 * led_irradiance(flat, SMALL, 4))


def test_a_box_is_a_piece_of_the_whole() -> None:
    surface = sample(press_object("BALL", 0.5, SMALL, size=256), SMALL, 2.0, 1.0)
    box = (slice(30, 90), slice(60, 120))
    whole = ring_irradiance(surface, SMALL, ring_light(SMALL))
    np.testing.assert_allclose(ring_irradiance(surface, SMALL, ring_light(SMALL), box), whole[box], rtol=1e-12)


def test_a_gentle_ball_casts_no_shadow_on_itself() -> None:
    surface = sample(press_object("BALL", 0.3, GEOMETRY), GEOMETRY, 0.0, 0.0)
    x, y = pixel_grid(GEOMETRY)
    for position in led_positions(GEOMETRY)[::3]:
        assert visibility(surface.depth_mm, (x[0], y[:, 0]), position).min() == 1


def test_shadows_agree_with_brute_force() -> None:
    surface = sample(press_object("BALL", 2.0, GEOMETRY, size=256), SMALL, 6.0, -2.0)
    x, y = pixel_grid(SMALL)
    shadowed = 0
    for position in led_positions(SMALL)[[1, 4, 7, 11]]:
        fast = visibility(surface.depth_mm, (x[0], y[:, 0]), position)
        slow = ray_marched(surface.depth_mm, x[0], y[:, 0], position)
        assert np.mean((fast > 0.5) != slow) < 0.004, "the two may differ along the shadow's edge only"
        shadowed += int((~slow).sum())
    assert shadowed > 100, "a ball this deep throws shadows"


def ray_marched(depth: np.ndarray, x: np.ndarray, y: np.ndarray, led: np.ndarray) -> np.ndarray:
    """(H, W) whether each pixel sees the light, by walking along its ray in small steps."""
    pixel = x[1] - x[0]
    seen = np.ones(depth.shape, bool)
    for step in np.linspace(0.001, 0.15, 150):  # shares of the way to the light: above 3 mm nothing stands
        rows = (1 - step) * np.arange(len(y))[:, None] + step * (led[1] - y[0]) / pixel
        columns = (1 - step) * np.arange(len(x))[None, :] + step * (led[0] - x[0]) / pixel
        surface = map_coordinates(depth, np.broadcast_arrays(rows, columns), order=1, mode="nearest")
        seen &= surface <= depth + step * (led[2] - depth) + 1e-3
    return seen


def test_normals_have_unit_length_and_point_to_the_camera() -> None:
    slopes = np.random.default_rng(0).normal(size=(5, 7, 2))
    normal = normals(slopes)
    assert np.linalg.norm(normal, axis=2) == pytest.approx(1)
    assert (normal[..., 2] > 0).all()
    assert -normal[..., :2] / normal[..., 2:] == pytest.approx(slopes)


def test_grey_is_light_by_exposure_crosstalk_and_gamma() -> None:
    light, response = np.random.default_rng(0).random((4, 5, 3)), CameraResponse()
    assert linear_grey(light, CameraResponse(exposure=0.5, crosstalk=IDENTITY)) == pytest.approx(127.5 * light)
    red = linear_grey(np.array([[[1.0, 0.0, 0.0]]]), response)[0, 0]
    assert red / 255 == pytest.approx([row[0] for row in response.crosstalk])
    assert np.sum(response.crosstalk, axis=1) == pytest.approx(1), "grey light stays grey"
    steps = np.repeat(np.array([0.0, 0.25, 1.0])[:, None, None], 3, axis=2)
    assert linear_grey(steps, CameraResponse(gamma=2.0))[:, 0, 0] == pytest.approx([0, 127.5, 255])


def test_the_noise_has_the_stated_deviation_and_quantisation_adds_a_twelfth() -> None:
    picture = digitise(np.full((400, 500, 3), 100.3, np.float32), 2.0, np.random.default_rng(1))
    assert picture.dtype == np.uint8
    assert picture.mean() == pytest.approx(100.3, abs=0.02)
    assert picture.std() == pytest.approx(np.sqrt(4 + 1 / 12), rel=0.01)


def test_too_much_light_clips_and_does_not_wrap() -> None:
    picture = expose(np.full((2, 2, 3), 5.0), CameraResponse(noise_grey=0.0), np.random.default_rng(0))
    assert (picture == 255).all()


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_the_exposure_puts_the_brightest_pixel_where_it_is_wanted(gamma: float) -> None:
    light = np.random.default_rng(2).random((6, 6, 3))
    exposure = exposure_for(light, CameraResponse(gamma=gamma), 200.0)
    assert linear_grey(light, CameraResponse(gamma=gamma, exposure=exposure)).max() == pytest.approx(200.0)


def test_pixels_are_counted_from_the_image_centre() -> None:
    x, y = pixel_grid(SensorGeometry(image_width_px=4, image_height_px=3, pixel_size_mm=0.5))
    assert x.ravel() == pytest.approx([-0.75, -0.25, 0.25, 0.75])
    assert y.ravel() == pytest.approx([-0.5, 0, 0.5])


def test_a_beam_of_120_degrees_is_lambertian_and_a_wider_one_flatter() -> None:
    assert SensorGeometry().emission_exponent == pytest.approx(1)
    assert SensorGeometry(beam_angle_rad=np.radians(160)).emission_exponent == pytest.approx(0.396, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        *((SensorGeometry, "mounting_height_mm", height) for height in (40.0, np.nan)),
        *((SensorGeometry, "led_colours", colours) for colours in ("RGX", "RG")),
        *((SensorGeometry, f"{name}_mm", np.nan) for name in ("gel_thickness", "camera_height", "coating_smoothing")),
        (SensorGeometry, "pixel_size_mm", 0.0), (SensorGeometry, "poisson_ratio", 0.5),
        (SensorGeometry, "incident_angle_rad", np.pi / 2), (SensorGeometry, "beam_angle_rad", np.pi),
        (SensorGeometry, "obliquity", -1.0), (partial(SensorGeometry, mounting_height_mm=33.0), "window", True),
        (CameraResponse, "exposure", 0.0), (CameraResponse, "gamma", -1.0), (CameraResponse, "noise_grey", -0.1),
    ],
)  # fmt: skip
def test_what_cannot_be_built_is_refused(kind: Callable[..., object], name: str, value: object) -> None:
    said = "must be positive" if kind is CameraResponse else name.replace("mounting_", "mounting.")
    with pytest.raises(ValueError, match=said):
        kind(**{name: value})


def plane(gx: float, gy: float) -> Surface:
    x, y = pixel_grid(SMALL)
    gradient = np.broadcast_to(np.array([gx, gy]), (*SMALL.image_shape, 2))
    return Surface(gx * x + gy * y, gradient, np.zeros(SMALL.image_shape, bool))


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
    x, y = (axis.ravel() for axis in pixel_grid(SMALL))
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
