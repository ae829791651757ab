"""The light of single LEDs on gel of any depth: the inverse square, and the reference simulator's pictures."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.photometric.lights_file import read_lights
from gellight.photometric.solver import Points
from gellight.reconstruction.led_light import LedLight, unit_normals
from sim_reference.camera import CameraResponse, linear_grey
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.surface import Surface
from sim_reference.view import seen_height_mm
from tests.helpers.simulated_light import WORLDS, simulated_light

MODEL = read_lights(load_bundle("synthetic"))
BLOCKS = (12, 16)


def points(depth_mm: float, x_mm: float = 0.0, y_mm: float = 0.0) -> Points:
    return Points(*(np.array([value], np.float32) for value in (x_mm, y_mm, depth_mm)))


def straight_above(height_mm: float) -> LedLight:
    """One LED that shines straight down through no window, which is all the light of each channel."""
    led = np.array([[0, 0, height_mm, 0, 0, 1]], np.float32)
    return replace(LedLight.of(MODEL, BLOCKS), leds=led, shares=np.ones((1, 3, *BLOCKS), np.float32), window_mm=0)


@pytest.mark.parametrize("depth_mm", [-0.5, 0.0, 0.7, 2.0])
def test_light_from_straight_above_grows_by_the_inverse_square(depth_mm: float) -> None:
    light = straight_above(20.0)
    lost = light.lost_by_depth(points(depth_mm), np.zeros((1, 2), np.float32), np.ones((1, 3, 1), np.float32))
    np.testing.assert_allclose(lost, 1 - (20 / (20 - depth_mm)) ** 2, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("geometry", WORLDS)
def test_what_a_point_has_more_is_what_the_simulator_shows_there(geometry: SensorGeometry) -> None:
    """A plate of one slope at two depths, in every pixel, for the light of the whole ring."""
    shape = geometry.image_shape
    slopes = np.broadcast_to(np.array([0.3, -0.2]), (*shape, 2))
    contact = np.ones(shape, np.bool_)
    response = CameraResponse(exposure=1.0)
    level, deep, rest = (
        linear_grey(ring_irradiance(Surface(np.full(shape, depth), gradient, contact), geometry, ring_light(geometry)),
                    response)
        for depth, gradient in ((0.0, slopes), (1.2, slopes), (0.0, np.zeros((*shape, 2))))
    )  # fmt: skip
    light = simulated_light(geometry, 1)
    y, x = (np.indices(shape).reshape(2, -1) - (np.array(shape)[:, None] - 1) / 2) * geometry.pixel_size_mm
    at = Points.seen_at(x, y, np.full(x.shape, 1.2), seen_height_mm(geometry))
    lost = light.lost_by_depth(at, slopes.reshape(-1, 2), light.shares.reshape(len(light.leds), 3, -1))
    true = ((level - deep) / rest).reshape(-1, 3).T
    assert np.abs(true).max() > 0.03
    # The camera is taken to be as high everywhere as it seems to be near the axis: .04 mm beside it in the corners.
    np.testing.assert_allclose(lost, true, atol=4e-3 if geometry.perspective else 5e-4)
    assert np.abs(lost - true).mean() < 5e-4


def test_light_that_is_given_and_taken_again_changes_nothing() -> None:
    random = np.random.default_rng(0)
    seen, lost = random.uniform(-60, 60, (50, 3)), random.uniform(-0.1, 0.1, (50, 3))
    rest = random.uniform(100, 180, (50, 3))
    light = replace(LedLight.of(MODEL, BLOCKS), gamma=1.8, black=np.array([3.0, 4, 5], np.float32))
    again = light.with_light(light.with_light(seen, lost, rest), -lost, rest)
    np.testing.assert_allclose(again, seen, atol=2e-3)


def test_no_picture_is_darker_than_black() -> None:
    light = replace(LedLight.of(MODEL, BLOCKS), gamma=1.8)
    rest = np.full((1, 3), 100.0)
    darkest = light.with_light(np.full((1, 3), -95.0), np.full((1, 3), -0.5), rest)
    np.testing.assert_allclose(darkest + rest, light.black[None], atol=1e-3)


def test_normals_are_unit_vectors_against_the_slopes() -> None:
    normal = unit_normals(np.array([[3.0, -4.0], [0.0, 0.0]], np.float32))
    np.testing.assert_allclose(normal, np.array([[-3, 4, 1], [0, 0, np.sqrt(26)]]).T / np.sqrt(26), rtol=1e-6)
