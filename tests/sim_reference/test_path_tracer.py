"""The reference behind a pinhole and a window against a path tracer: places, and the light that arrives, absolute."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_reference import view
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import arriving_light
from sim_reference.refraction import medium_of
from sim_reference.surface import Surface, press_object, sample, untouched

pytestmark = pytest.mark.nightly
pytest.importorskip("mitsuba")
path_tracer: Any = pytest.importorskip("tests.helpers.path_tracer")
INDEX, ABOVE_MM, WINDOW_MM = 1.41, 32.0, 8.0
LAMP_MM, RADIUS_MM, PLACE_MM = (26.0, 0.0, 20.0), 12.0, (-2.0, -3.0)
PIXEL_MM = 0.0588
ALBEDO, RENDERS, PATHS, SHARES = 0.02, 32, 1024, 6
FINE = SensorGeometry(
    image_width_px=720, image_height_px=540, pixel_size_mm=PIXEL_MM, perspective=True, window=True,
    incident_angle_rad=0.0,
)  # fmt: skip
PRESSED = press_object("BALL", 1.2, FINE)


@pytest.fixture(scope="module")
def surface() -> Surface:
    return sample(PRESSED, FINE, *PLACE_MM)


def drawn(width: int, height: int) -> Any:
    """A picture of 37.6 mm x 28.2 mm of the gel in so many pixels, Mitsuba's."""
    film = replace(FINE, image_width_px=width, image_height_px=height, pixel_size_mm=37.6 / width)
    return path_tracer.Drawn(
        geometry=film, pressed=PRESSED, place_mm=PLACE_MM, lamp_mm=LAMP_MM, lamp_radius_mm=RADIUS_MM,
        tan_pixel=37.6 / width / 37.6, albedo=ALBEDO, most_segments=4,
    )  # fmt: skip


def on_gel_at_rest(tan_x: np.ndarray, tan_y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays of these tangents in air meet the gel at rest."""
    bent = np.sqrt(INDEX**2 + (INDEX**2 - 1) * (tan_x**2 + tan_y**2))
    return tan_x * (ABOVE_MM + WINDOW_MM / bent), tan_y * (ABOVE_MM + WINDOW_MM / bent)


def test_every_pixel_sees_the_point_that_the_path_tracer_sees(surface: Surface) -> None:
    film = drawn(40, 30)
    at = on_gel_at_rest(*film.tangents())
    points = film.seen()
    x, y = (view.between(axis, *at, FINE) for axis in view.places(surface.depth_mm, FINE))
    hit = points.any(axis=2)  # a few rays slip through between two triangles
    assert hit.mean() > 0.98
    assert np.hypot(x - points[..., 0], y - points[..., 1])[hit].max() < 0.2 * PIXEL_MM
    assert np.abs(view.between(surface.depth_mm, *at, FINE) - points[..., 2])[hit].max() < 0.005


def light_of_the_disc(surface: Surface) -> np.ndarray:
    """Radiance in each pixel per albedo, of a disc of radiance 1: of 300 lamps as small, spread evenly over it."""
    x, y = view.places(surface.depth_mm, FINE)
    total, count = np.zeros(FINE.image_shape), 300
    for k in range(count):
        away, turn = RADIUS_MM * np.sqrt((k + 0.5) / count), k * np.pi * (3 - np.sqrt(5))
        to_x, to_y = LAMP_MM[0] + away * np.cos(turn) - x, LAMP_MM[1] + away * np.sin(turn) - y
        light, to_z = arriving_light(FINE, 0, to_x, to_y, surface.depth_mm, medium_of(FINE))
        facing = to_z - surface.gradient_map[..., 0] * to_x - surface.gradient_map[..., 1] * to_y
        total += light * np.maximum(facing, 0) * surface.upright / count
    # Radiance is albedo / pi of the irradiance, of which the face lets a share pass, thinned by n^2.
    return total * RADIUS_MM**2 * view.rays(FINE).passing / INDEX**2


@pytest.mark.timeout(2400)
def test_the_light_is_that_of_the_path_tracer(surface: Surface) -> None:
    film = drawn(40, 30)
    at = on_gel_at_rest(*film.tangents(SHARES))
    found = np.mean([film.picture(PATHS, seed) for seed in range(RENDERS)], axis=0) / ALBEDO
    pressed, flat = (
        view.between(light_of_the_disc(lit), *at, FINE).reshape(30, SHARES, 40, SHARES).mean(axis=(1, 3))
        for lit in (surface, untouched(FINE))
    )
    # To the right the face mirrors the disc itself.
    shares = _blocks(found) / _blocks(pressed)
    relief, ball = pressed - flat, np.abs(pressed / flat - 1)[:, :24] > 0.02
    gain = float((relief[:, :24] * (found - flat)[:, :24])[ball].sum() / (relief[:, :24][ball] ** 2).sum())
    print(f"path tracer over the reference: {shares.min():.4f} to {shares.max():.4f}, shading of the ball {gain:.3f}")
    assert np.abs(shares - 1).max() < 0.02
    assert gain == pytest.approx(1, abs=0.12)  # where light that does not bend gives 1.5


def _blocks(picture: np.ndarray) -> np.ndarray:
    """Sums over 3 x 2 parts of the left of a picture of 40 x 30 pixels: their noise is about a per cent."""
    return picture[:, :24].reshape(3, 10, 2, 12).sum(axis=(1, 3))
