"""Surfaces whose depth and slopes are known in closed form: what the integrator and the frame path are measured on.

Lengths are pixels, positions are from the image centre, x right and y down; shapes are (H, W).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Surface:
    """A depth map and its exact gradient map, sampled at the pixel centres."""

    depth: Array
    """(H, W) px"""
    gradient_map: Array
    """(H, W, 2) d(depth)/dx, d(depth)/dy"""


def centred_grid(shape: tuple[int, int], centre: tuple[float, float] = (0.0, 0.0)) -> tuple[Array, Array]:
    """(H, W) x and y of the pixel centres from a point that is given from the image centre."""
    y, x = np.indices(shape, dtype=np.float64)
    return x - (shape[1] - 1) / 2 - centre[0], y - (shape[0] - 1) / 2 - centre[1]


def gaussian(shape: tuple[int, int], sigma: float, centre: tuple[float, float], height: float = 1.0) -> Surface:
    """height exp(-r^2 / (2 sigma^2)); 2.35 sigma across at half of its height."""
    x, y = centred_grid(shape, centre)
    depth = height * np.exp(-(x * x + y * y) / (2 * sigma**2))
    return Surface(depth, np.stack([-x, -y], axis=2) / sigma**2 * depth[..., None])


def smooth_cap(shape: tuple[int, int], diameter: float, centre: tuple[float, float], height: float = 1.0) -> Surface:
    """height (1 - r^2 / a^2)^3 inside the radius a: slope and curvature vanish at the rim."""
    x, y = centred_grid(shape, centre)
    a2 = (diameter / 2) ** 2
    inside = np.maximum(1 - (x * x + y * y) / a2, 0)
    return Surface(height * inside**3, np.stack([-x, -y], axis=2) * (6 * height / a2) * (inside**2)[..., None])


def sharp_cap(shape: tuple[int, int], diameter: float, centre: tuple[float, float]) -> Surface:
    """A sphere's cap on a flat plane: its slope jumps at the rim from 0.5 to 0."""
    x, y = centred_grid(shape, centre)
    a = diameter / 2
    radius2 = 5 * a * a
    r2 = x * x + y * y
    inside = r2 < a * a
    up = np.sqrt(np.maximum(radius2 - r2, a * a))
    depth = np.where(inside, up - np.sqrt(radius2 - a * a), 0)
    return Surface(depth, np.stack([-x, -y], axis=2) * np.where(inside, 1 / up, 0)[..., None])


def plane(shape: tuple[int, int], slope_x: float, slope_y: float) -> Surface:
    """A tilted plane through 0 at the image centre."""
    x, y = centred_grid(shape)
    slopes = np.broadcast_to(np.array([slope_x, slope_y]), (*shape, 2)).copy()
    return Surface(slope_x * x + slope_y * y, slopes)


def fitted_scale(found: NDArray[np.floating], true: NDArray[np.floating]) -> float:
    """Scale of `found` against `true` that fits best in the sense of least squares, free of their medians."""
    found, true = found - np.median(found), true - np.median(true)
    return float((found * true).sum() / (true * true).sum())
