"""The grid of pixels: where they lie on the gel, means over blocks of them, and what lies between their middles."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import DTypeLike, NDArray


def gel_points_mm(image_shape: tuple[int, int], pixel_size_mm: tuple[float, float]) -> NDArray[np.float64]:
    """Return the (H, W, 2) x and y of the middle of each pixel, mm from the image centre."""
    height, width = image_shape
    x = (np.arange(width) - (width - 1) / 2) * pixel_size_mm[0]
    y = (np.arange(height) - (height - 1) / 2) * pixel_size_mm[1]
    return np.stack(np.meshgrid(x, y), axis=-1)


def pixel_size_xy(pixel_size_mm: float | tuple[float, float]) -> tuple[float, float]:
    """Return a pixel size, one number or (x, y), as (x, y) mm; ValueError unless it is above 0."""
    x, y = np.broadcast_to(np.asarray(pixel_size_mm, np.float64), 2).tolist()
    if not (np.isfinite([x, y]).all() and x > 0 and y > 0):
        raise ValueError(f"pixel size {pixel_size_mm} mm: it must be above 0")
    return x, y


def block_means(image: NDArray[Any], side: int) -> NDArray[Any]:
    """Return the means over blocks of `side` x `side` pixels: (H, W, ...) -> (H // side, W // side, ...).

    image: uint8 or floating point. Floats keep their precision; means of uint8 are float32, from exact sums. Rows and
    columns that fill no block are left out.
    """
    height, width = (size // side * side for size in image.shape[:2])
    floats = image.dtype.kind == "f"
    sums_in = image.dtype if floats else np.min_scalar_type(255 * side**2)
    rows = _sums(image[:height, :width], side, sums_in)
    sums = _sums(rows.swapaxes(0, 1), side, sums_in).swapaxes(0, 1)
    return np.asarray(np.divide(sums, side**2, dtype=image.dtype if floats else np.float32))


def plane_means(planes: NDArray[Any], side: int) -> NDArray[Any]:
    """Return the block means of each plane: (K, H, W) -> (K, H // side, W // side)."""
    return np.moveaxis(block_means(np.moveaxis(planes, 0, 2), side), 2, 0)


def spread_blocks(blocks: NDArray[Any], side: int, image_shape: tuple[int, int]) -> NDArray[Any]:
    """Return the (H, W) pixels with the values of the (h, w) blocks they lie in; 0 or False beyond the last block."""
    pixels = np.zeros(image_shape, blocks.dtype)
    inside = np.repeat(np.repeat(blocks, side, axis=0), side, axis=1)[: image_shape[0], : image_shape[1]]
    pixels[: inside.shape[0], : inside.shape[1]] = inside
    return pixels


def between_blocks(blocks: NDArray[np.float32], side: int, image_shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return the (H, W, ...) pixels that are linear between the middles of (h, w, ...) blocks of `side` pixels a side.

    Beyond the outermost middles their values continue. The blocks cover the pixels.
    """
    size = blocks.shape[1] * side, blocks.shape[0] * side
    pixels = cv2.resize(np.ascontiguousarray(blocks), size, interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(pixels[: image_shape[0], : image_shape[1]], np.float32)


def bounding_box(marked: NDArray[np.bool_], margin: int = 0) -> tuple[slice, slice]:
    """Return rows and columns of the smallest rectangle around the marked (H, W) pixels, wider by `margin`.

    Both slices are empty where nothing is marked.
    """
    left, top, width, height = cv2.boundingRect(np.ascontiguousarray(marked).view(np.uint8))
    if not width:
        return slice(0, 0), slice(0, 0)
    rows, columns = ((max(first - margin, 0), first + n + margin) for first, n in ((top, height), (left, width)))
    return slice(*rows), slice(*columns)


def _sums(values: NDArray[Any], side: int, kind: DTypeLike) -> NDArray[Any]:
    """Sum each `side` neighbours along the first axis. One strided pass a neighbour is ten times as fast as a mean."""
    total = values[::side].astype(kind)
    for start in range(1, side):
        total += values[start::side]
    return total
