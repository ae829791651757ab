"""Near-field photometric stereo: slopes from pictures under lights whose positions are known.

A Lambertian point s with the unit normal n sees LED k, at p, with d = |p - s|, as

    I_k = rho R_k  f_k(z)  n . (p - s) / p_z ,    f_k(z) = (d_0 / d)^3 (a / a_0)^m

where R_k is what the untouched gel showed in the same pixel (there n = (0, 0, 1), z = 0), f_k is how the light at depth
z differs from that at depth 0 (inverse square, unit vector to the light, emission pattern cos^m about the LED's axis, a
the cosine), and rho an unknown factor common to all lights: albedo, exposure. R_k holds whatever else differs between
the lights: brightness, vignetting, the tint of the coating. So I = L (rho n) with the rows L_k = R_k f_k (p - s) / p_z
(Woodham 1980; near light: Iwahori et al. 1990), solved by least squares in grey levels, in which the noise is equal.
Behind a window p is where the LED seems to stand, and f_k holds the light that arrives (`light_through`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isinf
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import gel_points_mm
from gellight.photometric.ring_geometry import RingGeometry
from gellight.photometric.window import bent

Floats = NDArray[np.floating]
Bools = NDArray[np.bool_]
STEEPEST = 10.0
"""slopes are bounded to this (84 degrees): what is steeper lies in its own shadow from most of the ring"""
LEAST_LIGHTS = 3  # a scaled normal has three numbers
SHADOW_SHARE = 0.1  # chosen: less may be the model's error
SHADOW_DEVIATIONS = 4.0  # chosen: normal noise is taken for shadow once in 30,000


@dataclass(frozen=True, eq=False)
class Points:
    """N points of the gel: where they are, in mm."""

    x_mm: Floats
    y_mm: Floats
    z_mm: Floats
    seen_mm: tuple[Floats, Floats] | None = None
    """x and y of the gel at rest in the pixels that show them; None: those of the points"""

    @classmethod
    def seen_at(cls, x_mm: Floats, y_mm: Floats, z_mm: Floats, camera_height_mm: float) -> Self:
        """Return what a camera sees, so high above the gel, or infinitely, where it sees x, y of the gel at rest."""
        if isinf(camera_height_mm):
            return cls(x_mm, y_mm, z_mm)
        share = 1 - z_mm / np.float32(camera_height_mm)
        return cls(x_mm * share, y_mm * share, z_mm, (x_mm, y_mm))

    @property
    def at_rest(self) -> "Points":
        """The points of the gel at rest in their pixels."""
        x, y = self.seen_mm or (self.x_mm, self.y_mm)
        return Points(x, y, np.zeros_like(x))


def flat_gel(image_shape: tuple[int, int], pixel_size_mm: tuple[float, float]) -> Points:
    """Return the point of the untouched gel in every pixel, row by row, float32."""
    x, y = np.moveaxis(gel_points_mm(image_shape, pixel_size_mm).astype(np.float32), 2, 0).reshape(2, -1)
    return Points(x, y, np.zeros_like(x))


def light_rows(points: Points, references: Floats, ring: RingGeometry) -> Floats:
    """Return the rows L (K, 3, N) at the points, for references R (K, N) in grey levels; one light an LED."""
    rows = np.empty((len(references), 3, len(points.x_mm)), references.dtype)
    for k, (position, axis) in enumerate(zip(ring.positions_mm(), ring.axes(), strict=True)):
        led = position.tolist(), axis.tolist(), ring.emission_exponent
        rows[k] = light_row(points, references[k], *led, ring.window_mm)
    return rows


def light_row(
    points: Points, reference: Floats, position: Sequence[Any], axis: Sequence[Any], exponent: float,
    window_mm: float = 0.0,
) -> Floats:  # fmt: skip
    """Return L (3, N) for one LED, or for as many as there are points: position and axis (3,) or (3, N).

    reference: (N,) R. exponent: m. window_mm: of what bends the light; 0: nothing does.
    """
    if window_mm:
        brought, above = light_through(points, position, axis, exponent, window_mm)
        at_rest, above_rest = light_through(points.at_rest, position, axis, exponent, window_mm)
        share = reference * np.divide(brought, at_rest * above_rest, out=np.zeros_like(above), where=at_rest > 0)
        return np.stack([share * (position[0] - points.x_mm), share * (position[1] - points.y_mm), share * above])
    x, y, z = position[0] - points.x_mm, position[1] - points.y_mm, position[2] - points.z_mm
    sideways, across = x * x + y * y, x * axis[0] + y * axis[1]
    away, along = sideways, across
    if points.seen_mm:
        rest_x, rest_y = position[0] - points.seen_mm[0], position[1] - points.seen_mm[1]
        away, along = rest_x * rest_x + rest_y * rest_y, rest_x * axis[0] + rest_y * axis[1]
    ratio = (away + position[2] ** 2) / (sideways + z * z)
    leaving = (across + z * axis[2]) / (along + position[2] * axis[2])
    # (d0/d)^3 from distance and direction; the cosine to the axis has another d0/d in it, to the power m.
    factor = reference * ratio ** ((3 + exponent) / 2) * np.maximum(leaving, 0) ** exponent / position[2]
    return np.stack([factor * x, factor * y, factor * z])


def light_through(
    points: Points, position: Sequence[Any], axis: Sequence[Any], exponent: float, window_mm: float
) -> tuple[Floats, Floats]:
    """Return g and the height at which a LED behind a window seems to stand above points, (N,) each.

    The LED lights a point with the normal n as g n . (p' - s), where p' is where it seems to stand: the cosine at which
    the ray leaves to the power m, times the flux on a level mm^2, over that height.
    """
    x, y = position[0] - points.x_mm, position[1] - points.y_mm
    rays = bent(np.hypot(x, y), position[2] - window_mm, window_mm - points.z_mm)
    leaving = -((x * axis[0] + y * axis[1]) / rays.below_mm + axis[2]) * rays.cosine
    return np.maximum(leaving, 0) ** exponent * rays.flux / rays.above_mm, rays.above_mm


def solve(signals: Floats, rows: Floats, valid: Bools) -> Floats:
    """Return the scaled normals (3, N) that fit signals (K, N) under rows (K, 3, N) best, using what is `valid` (K, N).

    Where fewer than three lights are valid, all are used: the answer is then a guess from a shadowed pixel, and its
    place can be told from `valid`. Where the lights leave a direction open, it is answered by the gel at rest.
    """
    used = valid | (valid.sum(axis=0) < LEAST_LIGHTS)
    weighted = rows * used[:, None, :]
    right = np.zeros((3, rows.shape[2]), rows.dtype)
    for row, signal in zip(weighted, signals, strict=True):
        right += row * signal
    return predict(inverse(normal_matrix(weighted, rows)), right)


def normal_matrix(weighted: Floats, rows: Floats) -> Floats:
    """Return the upper half of the matrices (3, 3, N) of the normal equations for rows (K, 3, N)."""
    matrix = np.zeros((3, 3, rows.shape[2]), rows.dtype)
    for heavy, row in zip(weighted, rows, strict=True):
        for i in range(3):
            matrix[i, i:] += heavy[i] * row[i:]
    return matrix


def solve_robustly(signals: Floats, rows: Floats, valid: Bools, deviation: Floats) -> tuple[Floats, Bools]:
    """Solve, leave out the lights that the answer shows to be shadowed, and solve these points again.

    A light counts as shadowed where its signal is below the prediction by more than `SHADOW_SHARE` of it and four
    standard deviations (`deviation`, (K,)): what darkens a picture beyond its noise is an occluder, while nothing
    brightens it. Points that would keep fewer than three lights stay as they are. Returns (3, N) and what was
    used (K, N).
    """
    scaled = solve(signals, rows, valid)
    predicted = predict(rows, scaled)
    missing = predicted - signals
    dark = (missing > SHADOW_SHARE * predicted) & (missing > SHADOW_DEVIATIONS * deviation[:, None])
    kept = valid & ~dark
    again = np.flatnonzero((kept != valid).any(axis=0) & (kept.sum(axis=0) >= LEAST_LIGHTS))
    if len(again):
        scaled[:, again] = solve(signals[:, again], rows[:, :, again], kept[:, again])
        valid = valid.copy()
        valid[:, again] = kept[:, again]
    return scaled, valid


def predict(rows: Floats, scaled: Floats) -> Floats:
    """Return the signals (K, N) that scaled normals (3, N) would give under rows (K, 3, N): the product of each."""
    return np.asarray(rows[:, 0] * scaled[0] + rows[:, 1] * scaled[1] + rows[:, 2] * scaled[2])


def inverse(matrix: Floats) -> Floats:
    """Invert symmetric matrices (3, 3, N), of which the upper halves are read, by cofactors; singular ones give 0."""
    (a, b, c), (_, d, e), (_, _, f) = matrix
    result = np.empty_like(matrix)
    result[0, 0], result[0, 1], result[0, 2] = d * f - e * e, c * e - b * f, b * e - c * d
    result[1, 1], result[1, 2], result[2, 2] = a * f - c * c, b * c - a * e, a * d - b * b
    result[1, 0], result[2, 0], result[2, 1] = result[0, 1], result[0, 2], result[1, 2]
    determinant = a * result[0, 0] + b * result[0, 1] + c * result[0, 2]
    # Far below the product of the diagonal it means that the lights stand in one plane with the point.
    regular = determinant > 10 * np.finfo(matrix.dtype).eps * a * d * f
    result *= np.divide(1, determinant, out=np.zeros_like(determinant), where=regular)
    return result


def slopes(scaled: Floats) -> Floats:
    """Return (2, N) d(depth)/dx, d(depth)/dy from scaled normals (3, N), bounded by `STEEPEST`; 0 where none."""
    sideways = np.hypot(scaled[0], scaled[1])
    upright = np.maximum(scaled[2], sideways / STEEPEST)
    return np.asarray(np.divide(-scaled[:2], upright, out=np.zeros_like(scaled[:2]), where=upright > 0))
