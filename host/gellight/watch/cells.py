"""Images on cells of 8 x 8 pixels, which a comparison needs no finer."""

import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import between_blocks, block_means, gel_points_mm

Cells = NDArray[np.float32]
"""(h, w, 3) RGB, grey levels, one value a cell"""

CELL_PX = 8  # chosen: the noise of such means is an eighth


def cell_means(image: NDArray[np.uint8] | NDArray[np.float32]) -> Cells:
    """Return the (h, w, 3) mean of each cell of an (H, W, 3) image, grey levels; a cell that is cut is left out."""
    return block_means(image, CELL_PX)


def spread(cells: Cells, image_shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return the (H, W, 3) image that is linear between the centres of (h, w, 3) cells and constant beyond them."""
    whole = between_blocks(cells.astype(np.float32, copy=False), CELL_PX, image_shape)
    beyond = [(0, size - covered) for size, covered in zip(image_shape, whole.shape, strict=False)]
    return np.pad(whole, [*beyond, (0, 0)], mode="edge")


def positions_mm(
    image_shape: tuple[int, int], pixel_size_mm: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(h, w) x and y of the centre of each cell, mm from the image centre, y down."""
    points = block_means(gel_points_mm(image_shape, pixel_size_mm), CELL_PX)
    return points[..., 0], points[..., 1]
