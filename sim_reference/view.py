"""What a camera at a finite height sees through the window: in each pixel the point of the gel that its ray meets.

A pixel is a place p of the gel at rest, for what lens and window distort of that plane is taken out of the picture. Its
ray goes on below that plane with the tangents T = p / a in the gel, where a is how high above p the camera seems to
stand (`refraction.Rays.above_mm`, Snell's law at the window's face). The gel that is d deep is seen at the p with

    x = p - d T = p (1 - d / a),    p = x a / (a - d).

Near the axis a is H = n (h - t) + t for a camera h above the coating, behind the window of thickness t and index n; in
air it is h everywhere. Under the defaults H is 53.1 mm and a 57.4 mm in the corners of the view.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, maximum_filter

from sim_reference.geometry import WHOLE, Box, SensorGeometry, pixel_grid
from sim_reference.refraction import Rays, medium_of, trace

Array = NDArray[np.float64]
MET_MM = 1e-4
"""a ray that is nearer to the surface has met it"""
MOST_STEPS = 400


def seen_height_mm(geometry: SensorGeometry) -> float:
    """Return H, the height above the gel at rest at which the camera seems to stand, seen from the gel near the axis.

    Infinite for a camera that looks along parallel rays.
    """
    if not geometry.perspective:
        return float("inf")
    return float(trace(np.zeros(1), geometry.camera_height_mm, medium_of(geometry)).above_mm[0])


@lru_cache(maxsize=2)
def rays(geometry: SensorGeometry) -> Rays:
    """Return the rays between the pinhole and the gel at rest in every pixel, (H, W)."""
    x, y = pixel_grid(geometry)
    return trace(np.hypot(x, y), geometry.camera_height_mm, medium_of(geometry))


@lru_cache(maxsize=2)
def tangents(geometry: SensorGeometry) -> Array:
    """Return T (H, W, 2), along which each pixel's ray moves over the gel for a mm that it goes down."""
    return np.stack(np.broadcast_arrays(*pixel_grid(geometry)), axis=2) / rays(geometry).above_mm[..., None]


@lru_cache(maxsize=2)
def most_oblique(geometry: SensorGeometry) -> float:
    """Return the tangent of the most oblique ray; 0 for parallel rays."""
    return float(np.hypot(*np.moveaxis(tangents(geometry), 2, 0)).max()) if geometry.perspective else 0.0


def places(depth_mm: Array, geometry: SensorGeometry, box: Box = WHOLE) -> tuple[Array, Array]:
    """Return x and y, mm, of the gel that is `depth_mm` (H, W) deep where the pixels of `box` see it, in its precision.

    Along parallel rays these are the pixels' own, (1, w) and (h, 1).
    """
    x, y = (axis.astype(depth_mm.dtype) for axis in pixel_grid(geometry))
    x, y = x[:, box[1]], y[box[0]]
    if not geometry.perspective:
        return x, y
    share = 1 - depth_mm[box] / np.asarray(rays(geometry).above_mm[box], depth_mm.dtype)
    return x * share, y * share


def between(field: Array, x: Array, y: Array, geometry: SensorGeometry) -> Array:
    """Return what a (H, W) field over the pixels' places is at the places x, y, mm; linear between pixels."""
    (height, width), size = geometry.image_shape, geometry.pixel_size_mm
    at = [y / size + (height - 1) / 2, x / size + (width - 1) / 2]
    return np.asarray(map_coordinates(field, at, order=1, mode="nearest"))


def first_met(relief_mm: Array, geometry: SensorGeometry) -> Array:
    """Return the depth (H, W) at which each pixel's ray first meets the surface `relief_mm` (H, W).

    The relief lies over the pixels' places on the gel at rest and is linear between them. Each ray goes down from the
    highest point by what is left to the surface below it, over the most by which that can shrink in a mm: it never
    passes a point of the surface (Hart, Sphere tracing, The Visual Computer 12, 1996).
    """
    x, y = (axis.ravel() for axis in np.broadcast_arrays(*pixel_grid(geometry)))
    across, down = tangents(geometry).reshape(-1, 2).T
    fastest = 1 + _steepest(relief_mm, geometry).ravel() * np.hypot(across, down)
    depth, going = np.full(x.shape, float(relief_mm.max())), np.arange(x.size)
    for _ in range(MOST_STEPS):
        now = depth[going]
        left = now - between(relief_mm, x[going] - now * across[going], y[going] - now * down[going], geometry)
        depth[going] = now - left / fastest[going]
        going = going[left > MET_MM]
        if not going.size:
            break
    return depth.reshape(relief_mm.shape)


def _steepest(relief_mm: Array, geometry: SensorGeometry) -> Array:
    """Return the steepest slope of the surface (H, W) as far around each pixel as a ray goes between its heights."""
    rises = (np.abs(np.diff(relief_mm, axis=axis, append=np.take(relief_mm, [-1], axis))) for axis in (0, 1))
    steepness = np.hypot(*rises) / geometry.pixel_size_mm
    reach_mm = np.ptp(relief_mm) * most_oblique(geometry)
    return np.asarray(maximum_filter(steepness, 2 * (int(reach_mm / geometry.pixel_size_mm) + 2) + 1))


@lru_cache(maxsize=2)
def falloff(geometry: SensorGeometry) -> Array:
    """Return the share of its light that each pixel gets (H, W), 1 in the middle: cos^obliquity and Fresnel's loss."""
    seen, (row, column) = rays(geometry), (side // 2 for side in geometry.image_shape)
    return np.asarray(seen.leaving_cos**geometry.obliquity * seen.passing / seen.passing[row, column])
