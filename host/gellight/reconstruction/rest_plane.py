"""The plane that the gel at rest lies on.

Slopes that are wrong by little, but alike all over the view, tilt the whole depth map. Where the bundle says so
(`level_plane`, which a calibration decides on presses held out), the plane that the untouched gel lies on is taken off:
on one real sensor it halves the error of the depth, on another it adds a tenth.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
Plane = NDArray[np.float64]
"""(2,) mm per pixel to the right and down"""
_STEP = 4
"""pixels between those that are looked at"""
_BAND = 4
"""the outermost one in so many of the view, along each side"""
_LEAST_FREE = 0.4
"""of the pixels along a side, that have to be untouched"""
_SIDES = 3  # chosen: of four; the touch may lie at one
_ROUNDS = 4  # chosen: of weighting by what the one before left
_OUTLIER = 1.5
"""in medians: residuals beyond it count by their size"""
_SETTLES_S = 0.5
"""in which the plane follows by two thirds"""
_GAP_S = 1.0
"""after which, or where time does not go on, a frame stands for itself"""


class RestPlane:
    """The plane of one sensor; in frames that follow each other it moves slowly."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._plane: Plane | None = None
        self._time_s = -np.inf

    def following(self, depth_mm: Floats, touched: Bools, time_s: float) -> Plane:
        """Return the plane to take off a frame, from its (H, W) depth and touched pixels.

        Where too little gel is untouched it is that of the frame before; where there was none, flat.
        """
        passed = time_s - self._time_s
        if not 0 < passed < _GAP_S:
            self._plane = None
        self._time_s = time_s
        self._follow(plane_at_rest(depth_mm, touched), passed)
        return np.zeros(2) if self._plane is None else self._plane

    def _follow(self, new: Plane | None, passed: float) -> None:
        if new is None:
            return
        share = 1.0 if self._plane is None else 1 - np.exp(-passed / _SETTLES_S)
        self._plane = new if self._plane is None else self._plane + share * (new - self._plane)


def tilt(plane: Plane, shape: tuple[int, ...]) -> Floats:
    """Return the (H, W) height of a plane, 0 in the middle, mm."""
    x, y = (np.arange(n, dtype=np.float32) - np.float32((n - 1) / 2) for n in shape[::-1])
    return np.asarray(np.float32(plane[1]) * y[:, None] + np.float32(plane[0]) * x, np.float32)


def plane_at_rest(depth_mm: Floats, touched: Bools) -> Plane | None:
    """Fit a plane to the untouched pixels of a (H, W) depth map; None where fewer than three sides are free.

    Robust least squares over every fourth pixel: what bulges beside a touch, or was touched unnoticed, counts less.
    """
    grid = (slice(_STEP // 2, None, _STEP),) * 2
    free = ~touched[grid]
    if not _enough(free):
        return None
    rows, columns = np.nonzero(free)
    terms = np.stack([np.ones(len(rows)), _STEP * columns, _STEP * rows], axis=1)
    depth, weight = depth_mm[grid][free].astype(np.float64), np.ones(len(rows))
    for _ in range(_ROUNDS):
        weighted = weight[:, None] * terms
        plane = np.linalg.solve(terms.T @ weighted, weighted.T @ depth)
        off = np.abs(depth - terms @ plane)
        weight = 1 / np.maximum(1, off / (_OUTLIER * np.median(off) + 1e-9))
    return np.asarray(plane[1:])


def _enough(free: Bools) -> bool:
    """Tell whether enough is untouched along three sides."""
    rows, columns = (max(2, n // _BAND) for n in free.shape)
    if min(free.shape) < 2:
        return False
    sides = (free[:rows], free[-rows:], free[:, :columns], free[:, -columns:])
    return sum(float(side.mean()) >= _LEAST_FREE for side in sides) >= _SIDES
