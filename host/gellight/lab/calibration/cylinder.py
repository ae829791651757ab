"""The imprint of a cylinder with a flat end: a circle of known diameter, found to a fraction of a pixel.

Where is the edge? Under the flat end the gel is flat. Beside a rigid edge the slope of an elastic surface falls as one
over the square root of the distance (Sneddon 1965, the flat-ended punch), and the coating smooths that with a Gaussian
of some width s. So across the edge the picture changes as

    f(t) = integral from 0 to infinity of exp(-(t - u)^2 / 2 s^2) / sqrt(u) du,    t outwards from the edge,

which is neither steepest nor highest at the edge. It is fitted, in sectors around the circle, with its place, width and
height free; the colour matters only by how much it changes.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import least_squares
from scipy.special import pbdv

from gellight.base.errors import InputError
from gellight.lab.training.labelling.pattern import without

Floats = NDArray[np.float64]
SECTORS = 48  # chosen: 7.5 degrees each; half of them must show the edge
REACH = 0.45
"""the profile is looked at within this share of the radius on either side of the edge"""
_STEP_PX = 0.25  # chosen: a quarter of a pixel, as the picture is interpolated
_LEAST_RADIUS_PX = 12.0  # chosen: an edge that is 0.12 px off is then 1 % of the scale
_LARGEST_SCATTER = 0.03  # chosen: of the radius; what scatters more is no circle


@dataclass(frozen=True, kw_only=True, eq=False)
class Imprint:
    """The edge of one cylinder press: an ellipse along the axes of the picture."""

    center_x_px: float
    center_y_px: float
    radius_x_px: float
    radius_y_px: float
    scatter_px: float
    """root mean square distance of the edge points from the ellipse"""
    edge_px: Floats
    """(n, 2) points x, y on the edge"""


def find_cylinder(difference: NDArray[np.float32], noise_grey: float) -> Imprint:
    """Find the imprint of a flat-ended cylinder in a (H, W, 3) difference image, grey levels.

    Raises InputError where nothing is pressed, the circle leaves the picture, or the edge is no circle.
    """
    center, radius = _rough_circle(difference, noise_grey)
    for _ in range(2):
        points = _edge_points(difference, center, radius)
        imprint = _fit_ellipse(points)
        center = (imprint.center_x_px, imprint.center_y_px)
        radius = (imprint.radius_x_px + imprint.radius_y_px) / 2
    _check(imprint, difference.shape[:2])
    return imprint


def _rough_circle(difference: NDArray[np.float32], noise_grey: float) -> tuple[tuple[float, float], float]:
    """Centre and radius in px: the pixels that changed most lie on the rim, all around it."""
    change = gaussian_filter(np.abs(difference).max(axis=2), 2.0)
    level = max(0.35 * float(np.quantile(change, 0.998)), 3 * noise_grey)
    rows, columns = np.nonzero(change > level)
    if len(rows) < 50:
        raise InputError("nothing is pressed into the gel, or too lightly: press the cylinder a little deeper")
    weight = change[rows, columns]

    def distance(circle: Floats) -> Floats:
        return np.asarray((np.hypot(columns - circle[0], rows - circle[1]) - circle[2]) * np.sqrt(weight))

    start = np.array([columns.mean(), rows.mean(), 0.0])
    start[2] = np.hypot(columns - start[0], rows - start[1]).mean()
    x, y, radius = least_squares(distance, start, loss="soft_l1", f_scale=20.0).x
    if not radius > _LEAST_RADIUS_PX:
        raise InputError(f"the imprint has a radius of only {radius:.1f} px: press the cylinder straight and deeper")
    return (float(x), float(y)), float(radius)


def _edge_points(difference: NDArray[np.float32], center: tuple[float, float], radius: float) -> Floats:
    """(n, 2) the place of the edge in each sector around the circle."""
    offsets = np.arange(-REACH * radius, REACH * radius, _STEP_PX)
    rays = 8 * SECTORS
    angles = 2 * np.pi * np.arange(rays) / rays
    x = center[0] + (radius + offsets) * np.cos(angles)[:, None]
    y = center[1] + (radius + offsets) * np.sin(angles)[:, None]
    seen = [map_coordinates(difference[..., c], [y, x], order=1, mode="nearest") for c in range(3)]
    profiles = np.stack(seen, axis=2).reshape(SECTORS, -1, len(offsets), 3).mean(axis=1)
    height, width = difference.shape[:2]
    seen_whole = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    inside = seen_whole.reshape(SECTORS, -1).all(axis=1)
    points = []
    for sector in np.flatnonzero(inside):
        at, reliable = _edge_offset(profiles[sector], offsets)
        if reliable:
            turn = 2 * np.pi * (sector * 8 + 3.5) / rays
            points.append((center[0] + (radius + at) * np.cos(turn), center[1] + (radius + at) * np.sin(turn)))
    if len(points) < SECTORS // 2:
        raise InputError(
            f"the edge of the cylinder is seen in {len(points)} of {SECTORS} directions only: press it so that its "
            "whole end is in the picture, straight and a little deeper"
        )
    return np.array(points)


def edge_profile(t_px: Floats, width_px: float) -> Floats:
    """Return f(t) of this module up to its height, for a width of the coating."""
    at, shape = _profile_table()
    z = t_px / width_px
    return np.asarray(np.where(z > at[-1], 1 / np.sqrt(np.maximum(z, 1.0)), np.interp(z, at, shape)))


@cache
def _profile_table() -> tuple[Floats, Floats]:
    """f over z = t / s, by a parabolic cylinder function: f ~ exp(-z^2 / 4) D(-1/2, -z); beyond 6 it is 1 / sqrt(z)."""
    z = np.linspace(-12.0, 6.0, 3601)
    f = np.exp(-(z**2) / 4) * pbdv(-0.5, -z)[0] / np.sqrt(2)
    return z, f


def _edge_offset(profile: NDArray[np.floating], offsets: Floats) -> tuple[float, bool]:
    """Where the edge lies on a (n, 3) colour profile, px from the circle assumed, and whether the fit is reliable."""
    flat = offsets < -0.5 * abs(float(offsets[0]))
    change = profile - np.median(profile[flat], axis=0)
    _, _, directions = np.linalg.svd(change, full_matrices=False)
    signal = change @ directions[0]
    signal = signal * np.sign(signal[np.argmax(np.abs(signal))])
    peak = float(offsets[np.argmax(signal)])

    near = np.abs(offsets - peak) < 0.3 * abs(float(offsets[0])) / REACH

    def misfit(p: Floats) -> Floats:
        """(n,) what no height, level and slope of an edge of this place and logarithm of the width explain."""
        shape = edge_profile(offsets[near] - p[0], float(np.exp(p[1])))
        columns = np.stack([np.ones_like(shape), shape, offsets[near] * shape], axis=1)
        return without(columns, signal[near, None])[:, 0]

    # Steps of a hundredth: the profile is interpolated in a table.
    found = least_squares(misfit, [peak - 1.5, np.log(2.0)], diff_step=1e-2, method="lm", xtol=1e-5, ftol=1e-6)
    at, width = float(found.x[0]), float(np.exp(found.x[1]))
    spread = float(np.sqrt(np.mean(found.fun**2)))
    sound = peak - 12 < at < peak + 6 and 0.3 < width < 12
    return at, sound and spread < 0.25 * float(np.ptp(signal))


def _fit_ellipse(points: Floats) -> Imprint:
    """The ellipse along the axes through the points; outliers count little."""

    def distance(e: Floats) -> Floats:
        x, y = (points[:, 0] - e[0]) / e[2], (points[:, 1] - e[1]) / e[3]
        return np.asarray((np.hypot(x, y) - 1) * (e[2] + e[3]) / 2)

    center = points.mean(axis=0)
    radius = float(np.hypot(*(points - center).T).mean())
    found = least_squares(distance, [*center, radius, radius], loss="soft_l1", f_scale=0.5).x
    scatter = float(np.sqrt(np.median(distance(found) ** 2) / 0.455))
    return Imprint(
        center_x_px=float(found[0]),
        center_y_px=float(found[1]),
        radius_x_px=float(found[2]),
        radius_y_px=float(found[3]),
        scatter_px=scatter,
        edge_px=points,
    )


def _check(imprint: Imprint, shape: tuple[int, ...]) -> None:
    x, y = imprint.center_x_px, imprint.center_y_px
    radius = max(imprint.radius_x_px, imprint.radius_y_px)
    if min(x, y, shape[1] - 1 - x, shape[0] - 1 - y) < radius:
        raise InputError(
            f"the imprint around ({x:.0f}, {y:.0f}) px with a radius of {radius:.0f} px leaves the picture of "
            f"{shape[1]} x {shape[0]} px: press nearer to the middle"
        )
    if imprint.scatter_px > _LARGEST_SCATTER * radius:
        raise InputError(
            f"the edge scatters by {imprint.scatter_px:.1f} px around a circle of {radius:.1f} px: press the flat "
            "end of the cylinder straight, without sliding"
        )
