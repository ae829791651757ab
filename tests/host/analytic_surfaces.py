"""Surfaces whose depth and slopes are known in closed form, in units of pixels."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Surface:
    depth: np.ndarray
    gradient_map: np.ndarray


def centred_grid(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """x, y in px from the image centre."""
    y, x = np.indices(shape, dtype=np.float64)
    return x - (shape[1] - 1) / 2, y - (shape[0] - 1) / 2


def gaussian(shape: tuple[int, int], sigma: float, centre: tuple[float, float], height: float = 1.0) -> Surface:
    x, y = centred_grid(shape)
    x, y = x - centre[0], y - centre[1]
    depth = height * np.exp(-(x * x + y * y) / (2 * sigma**2))
    return Surface(depth, np.stack([-x, -y], axis=2) / sigma**2 * depth[..., None])


def smooth_cap(shape: tuple[int, int], diameter: float, centre: tuple[float, float], height: float = 1.0) -> Surface:
    """(1 - r^2 / a^2)^3 inside the radius a: flat rim, the slope and its derivative are continuous."""
    x, y = centred_grid(shape)
    x, y = x - centre[0], y - centre[1]
    a2 = (diameter / 2) ** 2
    inside = np.maximum(1 - (x * x + y * y) / a2, 0)
    return Surface(height * inside**3, np.stack([-x, -y], axis=2) * (6 * height / a2) * (inside**2)[..., None])


def sharp_cap(shape: tuple[int, int], diameter: float, centre: tuple[float, float]) -> Surface:
    """A sphere's cap on a flat plane: its slope jumps at the rim, from 0.5 to 0."""
    x, y = centred_grid(shape)
    x, y = x - centre[0], y - centre[1]
    a = diameter / 2
    radius = a * np.sqrt(5)
    r2 = x * x + y * y
    inside = r2 < a * a
    up = np.sqrt(np.maximum(radius**2 - r2, a * a))
    depth = np.where(inside, up - np.sqrt(radius**2 - a * a), 0)
    return Surface(depth, np.stack([-x, -y], axis=2) * np.where(inside, 1 / up, 0)[..., None])


def plane(shape: tuple[int, int], slope_x: float, slope_y: float) -> Surface:
    x, y = centred_grid(shape)
    slopes = np.broadcast_to([slope_x, slope_y], (*shape, 2)).copy()
    return Surface(slope_x * x + slope_y * y, slopes)


def fitted_scale(found: np.ndarray, true: np.ndarray) -> float:
    """Best scale of `found` against `true` in the sense of least squares, free of their offsets."""
    found, true = found - np.median(found), true - np.median(true)
    return float((found * true).sum() / (true * true).sum())
