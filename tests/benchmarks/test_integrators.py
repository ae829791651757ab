"""The integrator on surfaces that are known by a formula, and that are what they say they are."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from gellight.reconstruction.integration import integrate
from tests.helpers.analytic_surfaces import Surface, fitted_scale, gaussian, plane, sharp_cap, smooth_cap

SHAPES = ((240, 320), (480, 640))
SIZES_PX = (5, 10, 20, 40, 60)
"""of a bump its width at half height, of a cap its diameter"""
POSITIONS = 16
Maker = Callable[[tuple[int, int], float, tuple[float, float]], Surface]
SURFACES: dict[str, Maker] = {
    "gaussian": lambda shape, size, centre: gaussian(shape, size / np.sqrt(8 * np.log(2)), centre),
    "smooth cap": smooth_cap,
    "sharp cap": sharp_cap,
}


@dataclass(frozen=True)
class DepthScale:
    """What becomes of the height of one surface under `integrate`, float32."""

    surface: str
    size_px: float
    place: str
    shape: tuple[int, int]
    scale: float
    """best-fitting factor, 1 is right; the mean over the positions"""
    scale_spread: float
    """standard deviation over sub-pixel positions"""
    largest_error: float
    """of any pixel, relative to the height of the surface"""


def depth_scales() -> list[DepthScale]:
    found = []
    for shape in SHAPES:
        for size in SIZES_PX:
            for place in ("middle", "border"):
                found += [depth_scale(name, size, place, shape) for name in SURFACES]
        found.append(compared("plane", max(shape), "everywhere", shape, [plane(shape, 0.3, -0.2)]))
    return found


def depth_scale(name: str, size: float, place: str, shape: tuple[int, int]) -> DepthScale:
    """Average over sub-pixel positions: many for the sharp rim, which falls between other samples at each."""
    rng = np.random.default_rng(0)
    middle = 0.0 if place == "middle" else shape[1] / 2 - 0.2 * size
    count = POSITIONS if name == "sharp cap" else 4
    made = [SURFACES[name](shape, size, (middle + x, y)) for x, y in rng.uniform(-0.5, 0.5, (count, 2))]
    return compared(name, size, place, shape, made)


def compared(name: str, size: float, place: str, shape: tuple[int, int], surfaces: list[Surface]) -> DepthScale:
    scales, errors = [], []
    for surface in surfaces:
        depth = integrate(surface.gradient_map.astype(np.float32), 1.0)
        scales.append(fitted_scale(depth, surface.depth))
        error = depth - (surface.depth - np.median(surface.depth))
        errors.append(float(np.abs(error).max() / np.ptp(surface.depth)))
    return DepthScale(name, size, place, shape, float(np.mean(scales)), float(np.std(scales)), max(errors))


@pytest.fixture(scope="module")
def scales() -> list[DepthScale]:
    return depth_scales()


def test_the_integrator_keeps_what_the_documents_say(scales: list[DepthScale]) -> None:
    assert len(scales) == 2 * (5 * 2 * 3 + 1)
    for row in scales:
        print(row)
        if row.surface in ("gaussian", "plane"):
            assert row.scale == pytest.approx(1, abs=0.001), row
        elif row.surface == "smooth cap" and row.size_px >= 10:
            assert row.scale == pytest.approx(1, abs=0.005), row
    assert max(row.largest_error for row in scales if row.surface == "plane") < 1e-5


def test_sharp_rims_scatter_and_the_table_says_so(scales: list[DepthScale]) -> None:
    spreads = {row.size_px: row.scale_spread for row in scales if row.surface == "sharp cap"}
    assert spreads[5] > 0.03
    assert spreads[60] < 0.01
