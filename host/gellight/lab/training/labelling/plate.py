"""Plates of balls: a gel that is touched in many places at once, so that one picture shows many presses.

Balls on a plate stand in a square grid of known pitch, which gives the size of a pixel; what is not in the grid is no
ball. Where there is no picture of the untouched gel, it is taken from between the balls.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.base.errors import InputError
from gellight.lab.training.labelling.circle import PressCircle
from gellight.lab.training.presses import Ball

Floats = NDArray[np.float32]
_BLOCKS_A_RADIUS = 4
_AROUND = 7.0
"""in ball radii: side of the square whose median is the untouched gel; balls fill less than half of it"""
_OFF_GRID = 0.12
"""of the pitch: how far a ball may lie from its place"""
LEAST_BALLS = 5
"""a grid is known by: two directions, and some to spare"""


def untouched_between(image: NDArray[np.uint8], ball: Ball) -> Floats:
    """Return (H, W, 3) of the gel as it would be without balls, grey levels: medians over much more than a ball."""
    side = max(1, round(ball.radius_px / _BLOCKS_A_RADIUS))
    small = cv2.resize(
        image.astype(np.float32), (image.shape[1] // side, image.shape[0] // side), interpolation=cv2.INTER_AREA
    )
    window = 2 * round(_AROUND * ball.radius_px / side / 2) + 1
    medians = np.stack([ndimage.median_filter(small[..., c], window, mode="nearest") for c in range(3)], axis=2)
    smooth = cv2.GaussianBlur(medians, (0, 0), window / 6)
    return np.asarray(cv2.resize(smooth, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_CUBIC), np.float32)


@dataclass(frozen=True, kw_only=True)
class PlateGrid:
    """How the balls of a plate lie in the picture."""

    pitch_px: float
    """distance of neighbours, mean of both directions"""
    across_px: float
    """the same along the rows, and"""
    down_px: float
    """along the columns"""
    miss_px: float
    """root mean square distance of the balls from their places"""
    on_grid: tuple[bool, ...]
    """of the circles given, which are in it"""


def plate_grid(circles: Sequence[PressCircle], pitch_px: float) -> PlateGrid:
    """Fit a square grid, turned and moved in any way, to the centres of circles; pitch_px: roughly, within 20 %.

    Raises InputError where fewer than 5 circles are in one grid.
    """
    points = np.array([(circle.center_x_px, circle.center_y_px) for circle in circles])
    fits = [_grid_from(points, start, pitch_px) for start in range(len(points))]
    best = max(fits, key=lambda fit: int(fit[1].sum()), default=None)
    if best is None or best[1].sum() < LEAST_BALLS:
        raise InputError(
            f"the {len(points)} balls found are in no grid of about {pitch_px:.0f} px: check the pitch and "
            "the pixel size"
        )
    axes, on_grid, miss = best
    across, down = (float(np.linalg.norm(axis)) for axis in axes)
    return PlateGrid(
        pitch_px=(across + down) / 2, across_px=across, down_px=down, miss_px=miss, on_grid=tuple(on_grid.tolist())
    )


def _grid_from(
    points: NDArray[np.float64], start: int, pitch_px: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_], float]:
    """Grow a grid from one point: axes (2, 2) px along rows and columns, which points are in it, and how far off."""
    steps = points - points[start]
    length = np.hypot(*steps.T)
    near = np.flatnonzero(np.abs(length / pitch_px - 1) < 0.2)
    nothing = np.zeros((2, 2)), np.zeros(len(points), np.bool_), np.inf
    if not len(near):
        return nothing
    across = steps[near[np.argmax(np.abs(steps[near, 0]))]]
    across = across * np.sign(across[0] or 1)
    axes, origin = np.array([across, (-across[1], across[0])]), points[start]
    inside = nothing[1]
    for reach in (2.5, 4.5, 8.5, np.inf):  # from the middle outwards, as the axes become more exact
        places = (points - origin) @ np.linalg.inv(axes)
        nearest = np.rint(places)
        inside = (np.abs(places - nearest).max(axis=1) < _OFF_GRID) & (np.abs(nearest).max(axis=1) < reach)
        if inside.sum() < 3 or np.linalg.matrix_rank(nearest[inside] - nearest[inside].mean(axis=0)) < 2:
            return nothing
        columns = np.column_stack([nearest[inside], np.ones(int(inside.sum()))])
        amounts, *_ = np.linalg.lstsq(columns, points[inside], rcond=None)
        axes, origin = amounts[:2], amounts[2]
    missed = points[inside] - columns @ amounts
    return axes, inside, float(np.sqrt((missed**2).sum(axis=1).mean()))
