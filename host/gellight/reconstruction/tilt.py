"""The tilt of a depth map, taken off where the gel at rest shows it on three sides.

Light that is uneven in another way than at the calibration bends all slopes alike, and so tilts the whole surface.
Where the gel is at rest it is flat: a plane through the depth there is that tilt. Rest on one side, or on two, does not
tell a tilt from the gel that rises around a contact; nor does a gel that comes back so well that nothing but this rise
is left.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.at_rest import far_cells
from gellight.reconstruction.gelnet import CELL_PX

LEVELLED = "levelled"
"""flag of a tactile frame whose tilt was taken off"""
LEAST_REST_GREY = 0.5
"""`rest_grey` of a bundle from which its sensor is levelled"""
_CELL_PX = 8
_FAR_SHARE = 0.5
"""of the cells at rest, those farthest from a touch are looked at"""
_LEAST_SHARE = 0.02
"""of all cells, so many must be at rest on a side"""
_SIDES = 3
_ROUNDS = 4
_ROBUST = 1.5
"""residuals beyond so many times their median count by their size, not its square"""


def take_tilt_off(depth_mm: NDArray[np.float32], touched: NDArray[np.bool_]) -> bool:
    """Take the tilt off a (H, W) depth map, in place, and tell whether it was: rest has to be seen on three sides.

    touched: (H, W) pixels, or (ceil(H / 4), ceil(W / 4)) cells as the mask of the frame path has them. The height at
    the middle of the view stays as it is.
    """
    step = _CELL_PX if touched.shape == depth_mm.shape else _CELL_PX // CELL_PX
    free = ~touched[step // 2 :: step, step // 2 :: step]
    far = far_cells(free, _FAR_SHARE)
    height, width = depth_mm.shape
    rows, columns = np.nonzero(far)
    y, x = rows * _CELL_PX + _CELL_PX // 2, columns * _CELL_PX + _CELL_PX // 2
    seen = (y < height) & (x < width)
    y, x = y[seen], x[seen]
    if free.all() or not _on_three_sides(free, x / _CELL_PX, y / _CELL_PX):
        return False
    across, down = _tilt(x, y, depth_mm[y, x].astype(np.float64))
    depth_mm -= (across * (np.arange(width, dtype=np.float32) - (width - 1) / 2)).astype(np.float32)
    depth_mm -= (down * (np.arange(height, dtype=np.float32) - (height - 1) / 2)).astype(np.float32)[:, None]
    return True


def _on_three_sides(free: NDArray[np.bool_], x: NDArray[np.floating], y: NDArray[np.floating]) -> bool:
    """Whether points, in cells, lie on three sides of the middle of what is touched: above, below, left, right."""
    rows, columns = np.nonzero(~free)
    right, below = x - columns.mean(), y - rows.mean()
    sideways = np.abs(right) > np.abs(below)
    sides = [sideways & (right < 0), sideways & (right > 0), ~sideways & (below < 0), ~sideways & (below > 0)]
    return sum(int(side.sum()) >= _LEAST_SHARE * free.size for side in sides) >= _SIDES


def _tilt(x: NDArray[np.intp], y: NDArray[np.intp], depth_mm: NDArray[np.float64]) -> tuple[float, float]:
    """Slope of the plane through the points along x and y, mm per px."""
    columns = np.stack([np.ones(len(x)), x, y], axis=1)
    weights: NDArray[np.float64] = np.ones(len(x))
    plane: NDArray[np.float64] = np.zeros(3)
    for _ in range(_ROUNDS):
        weighted = columns * weights[:, None]
        plane = np.asarray(np.linalg.solve(weighted.T @ columns, weighted.T @ depth_mm), np.float64)
        left = np.abs(depth_mm - columns @ plane)
        weights = np.asarray(1 / np.maximum(1, left / max(_ROBUST * float(np.median(left)), 1e-9)), np.float64)
    return float(plane[1]), float(plane[2])
