"""Where the gel is at rest, so that depth can be counted from there."""

import cv2
import numpy as np
from numpy.typing import NDArray

_CELL_PX = 8


def far_from_touch(touched: NDArray[np.bool_], side: int = _CELL_PX) -> NDArray[np.bool_]:
    """Mark the quarter of the untouched (H, W) pixels that is farthest from any touched one.

    Gel that is pressed down in one place bulges out around it, with slopes too gentle to show in the image, and comes
    to rest some thicknesses of the gel farther out. The median over all untouched pixels would put 5 micrometres of
    bulge under a ball that is pressed 1 mm deep. Distances are chess-board distances between cells of `side` pixels a
    side: 8 for pixels, fewer where `touched` is of means of them.
    """
    free = ~touched
    return free_and_far(free, far_cells(free[side // 2 :: side, side // 2 :: side]), side)


def free_and_far(free: NDArray[np.bool_], far: NDArray[np.bool_], side: int) -> NDArray[np.bool_]:
    """Mark the free (H, W) pixels in far (h, w) cells; all that are free where no cell is far."""
    if not far.any():
        return free
    rows, columns = (
        np.minimum(np.arange(n) // side, cells - 1) for n, cells in zip(free.shape, far.shape, strict=True)
    )
    return np.asarray(free & far[rows[:, None], columns[None, :]])


def far_cells(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the farthest quarter of the free (h, w) cells; all of them where no cell is touched."""
    if free.all() or not free.any():
        return free
    distance = cv2.distanceTransform(np.ascontiguousarray(free).view(np.uint8), cv2.DIST_C, 3)
    distances = distance[free]
    place = -(-3 * (distances.size - 1) // 4)  # of the upper quartile among them, in ascending order
    return np.asarray(distance >= max(1, np.partition(distances, place)[place]))
