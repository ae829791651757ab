"""Which radius the pressed ball has, by the light alone: a check that the ball is the one that was named.

A matt surface under fixed light darkens with the cosine of its slope. Relative to the untouched gel a pixel of contact
has the brightness

    I / I0 = (a + b . g) cos(slope),    cos(slope) = sqrt(R^2 - r^2) / R,    g = -(x, y) / sqrt(R^2 - r^2)

with a free level a of each press and a response b that changes smoothly over the view. For every R this is a linear
least-squares problem, and the R that leaves least is the radius. That holds for a matt gel and a linear camera; where
the model explains the pictures badly, or no radius stands out, nothing is said.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gellight.lab.training.presses import Ball, Press

Floats = NDArray[np.float64]
TOLERANCE = 0.15
"""a named radius is questioned when the light says one that differs by more than this share"""
LEAST_PRESSES = 8
_INNER = 0.8
"""of the contact radius: a circle that is a little wide does not matter"""
_SAMPLES = 120
_SCAN = np.geomspace(0.5, 2.2, 31)
_LARGEST_RESIDUAL = 0.03
"""of the brightness: a model that leaves more does not hold for this sensor"""
_SHARPNESS = 1.15
"""the residual has to rise by this factor a quarter of the radius away on either side"""
_DARK_GREY = 8.0


def is_another(likely_mm: float, named_mm: float) -> bool:
    """Tell whether a likely radius contradicts the one that was named."""
    return abs(likely_mm / named_mm - 1) > TOLERANCE


def likely_radius_mm(
    images: Sequence[NDArray[np.uint8]], presses: Sequence[Press], reference: NDArray[np.float32], ball: Ball
) -> float | None:
    """Return the radius that explains the brightness of the contacts best, mm; None where the light does not tell.

    images: (H, W, 3) of the presses; reference: (H, W, 3) of the untouched gel, grey levels.
    """
    if len(presses) < LEAST_PRESSES:
        return None
    samples = [
        _sampled(i, image, press, reference) for i, (image, press) in enumerate(zip(images, presses, strict=True))
    ]
    place, offset, ratio, number = (np.concatenate(part) for part in zip(*samples, strict=True))
    radii = _SCAN * ball.radius_px
    left = np.array([_residual(radius, place, offset, ratio, number) for radius in radii])
    best = int(np.argmin(left))
    if not 0 < best < len(radii) - 1 or left[best] > _LARGEST_RESIDUAL:
        return None
    around = [np.interp(np.log(radii[best] * side), np.log(radii), np.minimum(left, 1e3)) for side in (0.75, 1.25)]
    if min(around) < _SHARPNESS * left[best]:
        return None
    return float(_lowest(np.log(radii[best - 1 : best + 2]), left[best - 1 : best + 2]) * ball.pixel_size_mm)


def _sampled(
    number: int, image: NDArray[np.uint8], press: Press, reference: NDArray[np.float32]
) -> tuple[Floats, Floats, Floats, NDArray[np.int64]]:
    """Pixels of one contact: place (N, 2) from -1 to 1, offset (N, 2) px, brightness ratio (N, 3), press (N,)."""
    height, width = image.shape[:2]
    rows, columns = np.indices((height, width))
    dx, dy = columns - press.center_x_px, rows - press.center_y_px
    bright = (reference > _DARK_GREY).all(axis=2) & (image < 255).all(axis=2)
    inside = np.flatnonzero((np.hypot(dx, dy) < _INNER * press.contact_radius_px) & bright)
    chosen = np.random.default_rng(number).choice(inside, min(_SAMPLES, len(inside)), replace=False)
    ratio = image.reshape(-1, 3)[chosen] / reference.reshape(-1, 3)[chosen]
    place = np.stack([2 * (chosen % width) / width - 1, 2 * (chosen // width) / height - 1], axis=1)
    offset = np.stack([dx.ravel()[chosen], dy.ravel()[chosen]], axis=1)
    return place, offset, ratio.astype(np.float64), np.full(len(chosen), number)


def _residual(radius: float, place: Floats, offset: Floats, ratio: Floats, number: NDArray[np.int64]) -> float:
    """Median absolute residual of the model with a ball of this radius, px; infinite where a contact is wider."""
    below = radius**2 - (offset**2).sum(axis=1)
    if below.min() <= 0:
        return float("inf")
    root = np.sqrt(below)[:, None]
    slopes, upright = -offset / root, root / radius
    x, y = place.T
    smooth = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    levels = np.eye(int(number.max()) + 1)[number]
    columns = np.concatenate([slopes[:, :1] * smooth, slopes[:, 1:] * smooth, levels], axis=1) * upright
    amounts, *_ = np.linalg.lstsq(columns, ratio, rcond=None)
    return float(np.median(np.abs(ratio - columns @ amounts)))


def _lowest(at: Floats, values: Floats) -> float:
    """Return exp of where the parabola through three points is lowest; the middle one where it is none."""
    if not np.isfinite(values).all():
        return float(np.exp(at[1]))
    bend, slope, _ = np.polyfit(at - at[1], values, 2)
    shift = -slope / (2 * bend) if bend > 0 else 0.0
    return float(np.exp(at[1] + np.clip(shift, at[0] - at[1], at[2] - at[1])))
