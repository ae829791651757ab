"""Normals from pictures under several lights, by least squares: the reconstruction that the paper optimises for.

A Lambertian point with normal n and albedo rho has the brightness I_k = rho n . l_k under light k. With the lights as
rows of a matrix L the scaled normal rho n is the least-squares solution of L (rho n) = I (Woodham, 1980).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def ring_directions(count: int, incident_angle_rad: float) -> Array:
    """(count, 3) unit vectors to lights around a circle, `incident_angle_rad` from the normal (section 2.3.1)."""
    if count < 3:
        raise ValueError(f"{count} lights: photometric stereo needs at least 3")
    azimuth = 2 * np.pi * np.arange(count) / count
    sideways = np.sin(incident_angle_rad)
    return np.stack(
        [sideways * np.cos(azimuth), -sideways * np.sin(azimuth), np.full(count, np.cos(incident_angle_rad))], axis=1
    )


def solve_normals(images: Array, directions: Array, shadow_level: float | None = None) -> Array:
    """Return unit normals (H, W, 3) from pictures (K, H, W) under lights (K, 3), or (K, H, W, 3) where light is near.

    With `shadow_level`, observations at or below it count as shadowed and are left out where at least three others
    remain. Raises ValueError for fewer than three pictures.
    """
    if len(images) < 3 or len(images) != len(directions):
        raise ValueError(f"{len(images)} pictures and {len(directions)} lights: give as many, at least 3")
    if directions.ndim == 2 and shadow_level is None:
        scaled = np.einsum("ik,khw->hwi", np.linalg.pinv(directions), images)
    else:
        scaled = _weighted_normals(images, directions, shadow_level)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return np.asarray(
        np.divide(scaled, length, out=np.broadcast_to([0.0, 0.0, 1.0], scaled.shape).copy(), where=length > 0)
    )


def _weighted_normals(images: Array, directions: Array, shadow_level: float | None) -> Array:
    lit = np.ones_like(images) if shadow_level is None else (images > shadow_level).astype(np.float64)
    lit = np.where(lit.sum(axis=0) >= 3, lit, 1.0)
    lights = directions[:, None, None, :] if directions.ndim == 2 else directions
    weighted = lit[..., None] * lights
    matrix = np.einsum("khwi,khwj->hwij", weighted, np.broadcast_to(lights, weighted.shape))
    right = np.einsum("khwi,khw->hwi", weighted, images)
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
