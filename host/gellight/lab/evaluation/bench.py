"""Measure the depth scale of the integrator."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from gellight.lab.evaluation.analytic_surfaces import Surface, fitted_scale, gaussian, plane, sharp_cap, smooth_cap
from gellight.lab.evaluation.frame_bench import FrameTimes
from gellight.lab.evaluation.simulated_presses import Figures
from gellight.lab.evaluation.synthetic import SimulatedError
from gellight.reconstruction.integration import integrate

_SHAPES = ((240, 320), (480, 640))
_SIZES_PX = (5, 10, 20, 40, 60)
_POSITIONS = 16


@dataclass(frozen=True)
class DepthScale:
    """What becomes of the height of one analytic surface under `integrate`, float32."""

    surface: str
    size_px: float
    place: str
    image_width_px: int
    image_height_px: int
    scale: float
    """best-fitting factor, 1 is right; the mean over the positions"""
    scale_spread: float
    """standard deviation over sub-pixel positions"""
    largest_error: float
    """of any pixel, relative to the height of the surface"""


def depth_scales() -> list[DepthScale]:
    """Integrate Gaussians (size: width at half height), smooth and sharp caps (size: diameter) and a plane."""
    found = []
    for shape in _SHAPES:
        for size in _SIZES_PX:
            for place in ("middle", "border"):
                for name, make in _SURFACES.items():
                    found.append(_depth_scale(name, make, size, place, shape))
        found.append(_compared("plane", max(shape), "everywhere", shape, [plane(shape, 0.3, -0.2)]))
    return found


def as_rows(results: Sequence[FrameTimes | DepthScale | Figures | SimulatedError]) -> list[dict[str, object]]:
    """Turn results into plain dictionaries, for JSON."""
    return [asdict(result) for result in results]


Maker = Callable[[tuple[int, int], float, tuple[float, float]], Surface]
_SURFACES: dict[str, Maker] = {
    "gaussian": lambda shape, size, centre: gaussian(shape, size / np.sqrt(8 * np.log(2)), centre),
    "smooth cap": smooth_cap,
    "sharp cap": sharp_cap,
}


def _depth_scale(name: str, make: Maker, size: float, place: str, shape: tuple[int, int]) -> DepthScale:
    """Average over sub-pixel positions: many for the sharp rim, which falls between other samples at each."""
    rng = np.random.default_rng(0)
    middle = 0.0 if place == "middle" else shape[1] / 2 - 0.2 * size
    count = _POSITIONS if name == "sharp cap" else 4
    made = [make(shape, size, (middle + x, y)) for x, y in rng.uniform(-0.5, 0.5, (count, 2))]
    return _compared(name, size, place, shape, made)


def _compared(name: str, size: float, place: str, shape: tuple[int, int], surfaces: list[Surface]) -> DepthScale:
    scales, errors = [], []
    for surface in surfaces:
        depth = integrate(surface.gradient_map.astype(np.float32), 1.0)
        scales.append(fitted_scale(depth, surface.depth))
        error = depth - (surface.depth - np.median(surface.depth))
        errors.append(float(np.abs(error).max() / np.ptp(surface.depth)))
    return DepthScale(
        surface=name,
        size_px=size,
        place=place,
        image_width_px=shape[1],
        image_height_px=shape[0],
        scale=float(np.mean(scales)),
        scale_spread=float(np.std(scales)),
        largest_error=max(errors),
    )
