"""Images on cells of 8 x 8 pixels, which a comparison needs no finer."""

import functools

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Cells = NDArray[np.float32]
"""(h, w, 3) RGB, grey levels, one value a cell"""

CELL_PX = 8


def grid(image_shape: tuple[int, int]) -> tuple[int, int]:
    """(h, w) cells of an image of (H, W) pixels; pixels beyond the last whole cell are left out."""
    return image_shape[0] // CELL_PX, image_shape[1] // CELL_PX


def cell_means(image: NDArray[np.uint8] | NDArray[np.float32]) -> Cells:
    """Return the (h, w, 3) mean of each cell of an (H, W, 3) image, grey levels."""
    height, width = grid((image.shape[0], image.shape[1]))
    whole = image[: height * CELL_PX, : width * CELL_PX]
    kind = np.uint16 if whole.dtype == np.uint8 else np.float32
    rows = functools.reduce(np.add, [whole[i::CELL_PX].astype(kind) for i in range(CELL_PX)])
    sums = functools.reduce(np.add, [rows[:, i::CELL_PX] for i in range(CELL_PX)])
    return np.asarray(sums, np.float32) / np.float32(CELL_PX**2)


def spread(cells: Cells, image_shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return the (H, W, 3) image that is linear between the centres of (h, w, 3) cells and constant beyond them."""
    rows, columns = ((np.arange(size) - (CELL_PX - 1) / 2) / CELL_PX for size in image_shape)
    at = np.meshgrid(rows, columns, indexing="ij")
    planes = [ndimage.map_coordinates(cells[..., c], at, order=1, mode="nearest") for c in range(3)]
    return np.stack(planes, axis=2).astype(np.float32)


def positions_mm(
    image_shape: tuple[int, int], pixel_size_mm: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(h, w) x and y of the centre of each cell, mm from the image centre, y down."""
    height, width = grid(image_shape)
    x = (np.arange(width) * CELL_PX + (CELL_PX - image_shape[1]) / 2) * pixel_size_mm[0]
    y = (np.arange(height) * CELL_PX + (CELL_PX - image_shape[0]) / 2) * pixel_size_mm[1]
    columns, rows = np.meshgrid(x, y)
    return columns, rows
