"""Surfaces with a formula, moved rigidly: views of them whose motion is known to the last digit."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gellight_scan.tracking.rigid import carried, inverse, pose_of
from gellight_scan.tracking.view import View, eroded

Height = Callable[[np.ndarray, np.ndarray], np.ndarray]
PIXEL_MM = 0.1176
RADIUS_MM = 2.2
"""of what touches"""
SHAPE = (120, 160)
Y, X = ((np.arange(n) - (n - 1) / 2) * PIXEL_MM for n in SHAPE)
X, Y = np.meshgrid(X, Y)


def ball(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A ball of 5 mm radius, 1 mm deep."""
    return np.sqrt(np.maximum(25 - x**2 - y**2, 1.0)) - 4.0


def bar(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A bar of 5 mm radius along x."""
    return np.sqrt(np.maximum(25 - y**2, 1.0)) - 4.0 + 0 * x


def relief(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The ball with a gentle relief in every direction."""
    return ball(x, y) + 0.04 * (
        np.sin(1.9 * x + 0.7 * y) + np.sin(2.3 * y - 1.1 * x + 1) + np.sin(1.4 * x + 1.7 * y + 2)
    )


def faint(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The ball with the relief a twentieth as high: waves of 2 um."""
    return ball(x, y) + 0.05 * (relief(x, y) - ball(x, y))


def other(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The ball with another relief."""
    return ball(x, y) + 0.05 * (np.sin(2.8 * x - 1.7 * y + 2) + np.sin(2.2 * y + 2.1 * x) + np.sin(3.1 * x + 1))


def seen(height: Height, pose: np.ndarray | None = None, *, noise: float = 0.0, seed: int = 0) -> View:
    """What a sensor sees of a surface that was moved; it touches in a disc in the middle."""
    back = inverse(np.eye(4) if pose is None else pose)
    depth = height(X, Y)
    for _ in range(40):
        x, y, z = (back[row, 0] * X + back[row, 1] * Y + back[row, 2] * depth + back[row, 3] for row in range(3))
        depth = depth + 0.8 * (height(x, y) - z)
    down, across = np.gradient(depth, PIXEL_MM)
    planes = np.dstack([depth, across, down])
    touching = np.hypot(X, Y) < RADIUS_MM
    pixel = (PIXEL_MM, PIXEL_MM)
    middle = ((SHAPE[1] - 1) / 2, (SHAPE[0] - 1) / 2)
    view = View(planes.astype(np.float32), touching, eroded(touching, 0.12, pixel), pixel, middle)
    return noisy(view, noise, seed) if noise else view


def from_height(height: Height, pose: np.ndarray, height_mm: float, told_mm: float) -> View:
    """`seen` by a pinhole that stands `height_mm` above the gel, taken to stand at `told_mm`; 0: far away."""
    back = inverse(pose)
    share, depth = np.ones_like(X), height(X, Y)
    for _ in range(60):
        x, y, z = np.moveaxis(carried(back, np.dstack([share * X, share * Y, depth])), 2, 0)
        depth = depth + 0.8 * (height(x, y) - z)
        share = 1 - depth / height_mm
    wide, high = (np.gradient(share * axis, PIXEL_MM) for axis in (X, Y))
    down, across = np.gradient(depth, PIXEL_MM)
    turned = wide[1] * high[0] - wide[0] * high[1]
    slopes = (across * high[0] - down * high[1]) / turned, (down * wide[1] - across * wide[0]) / turned
    pixel = (PIXEL_MM, PIXEL_MM)
    view = View.of(depth.astype(np.float32), np.dstack(slopes), pixel, camera_height_mm=told_mm)
    touching = np.hypot(X - pose[0, 3], Y - pose[1, 3]) < RADIUS_MM
    return replace(view, touching=touching, inside=eroded(touching, 0.12, pixel))


def noisy(view: View, noise: float, seed: int, *, shared: float = 0.0) -> View:
    """The same view with noise in the slopes, and errors that all of the contact shares: a constant, and ever more."""
    random = np.random.default_rng(seed)
    planes = view.planes.copy()
    planes[..., 1:] += noise * random.standard_normal((*SHAPE, 2))
    for channel, size in enumerate((2 * shared, shared, shared)):
        constant, across, down = size * random.standard_normal(3)
        planes[..., channel] += constant + (across * X + down * Y) / 2.2
    return View(planes, view.touching, view.inside, view.pixel_mm, view.middle_px)


def nothing() -> View:
    """The gel at rest."""
    none = np.zeros(SHAPE, np.bool_)
    return View(np.zeros((*SHAPE, 3), np.float32), none, none, (PIXEL_MM, PIXEL_MM), (79.5, 59.5))


def moved(x: float, y: float, turn_deg: tuple[float, float, float], z: float = 0.0) -> np.ndarray:
    """The pose that moves the point in the middle, 1 mm deep, by (x, y, z) mm and turns about it."""
    return pose_of(np.array([x, y, z, *np.radians(turn_deg)]), np.array([0.0, 0.0, 1.0]))
