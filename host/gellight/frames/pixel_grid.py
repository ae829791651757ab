"""The grid of pixels: where they lie on the gel, means over blocks of them, and what lies between their middles.

A camera from a height shows some of it out of place. One that seems to stand at the height H above the gel at rest
shows the gel of the place x, d deep, in the pixel p = x / (1 - d / H), both from its axis. So the depth over the gel is
the fixed point of d = depth(x / (1 - d / H)).
"""

from math import ceil
from typing import Any

import cv2
import numpy as np
from numpy.typing import DTypeLike, NDArray

Floats = NDArray[np.float32]
Box = tuple[slice, slice]
_STEPS = 6
"""each is right to the share slope x / H of the one before, .4 at most where a slope of 1 lies in a corner"""
_FLAT_MM = 0.02
"""gel less deep is taken to lie where it is seen: 7 micrometres beside it at most, 19 mm from the axis"""


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


def area_means(plane: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    """Reduce an (H, W, ...) plane to `shape` by area averaging, so that no pixel is left out."""
    return np.asarray(cv2.resize(plane, (shape[1], shape[0]), interpolation=cv2.INTER_AREA))


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


def grown(marked: NDArray[np.bool_], steps: int, *, corners: bool = True) -> NDArray[np.bool_]:
    """Mark the (H, W) pixels within so many steps of a marked one too; corners: a step may go across a corner."""
    step = np.ones((3, 3), np.uint8) if corners else cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    return cv2.dilate(np.ascontiguousarray(marked).view(np.uint8), step, iterations=steps).view(np.bool_)


def connected(marked: NDArray[np.bool_], *, corners: bool = True) -> tuple[NDArray[np.int32], list[Box]]:
    """Return the number of the part that each marked (H, W) pixel is of, from 1 on, and the rectangle of each part.

    0 is what is not marked. corners: pixels that meet at a corner are of one part.
    """
    pixels = np.ascontiguousarray(marked).view(np.uint8)
    _, labels, measures, _ = cv2.connectedComponentsWithStats(pixels, connectivity=8 if corners else 4)
    boxes = measures[1:, [cv2.CC_STAT_TOP, cv2.CC_STAT_HEIGHT, cv2.CC_STAT_LEFT, cv2.CC_STAT_WIDTH]].tolist()
    return np.asarray(labels, np.int32), [(slice(y, y + h), slice(x, x + w)) for y, h, x, w in boxes]


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


def over_gel(maps: Floats, camera_height_mm: float) -> Floats:
    """Return maps (H, W) or (H, W, n), of which the first is the depth in mm, over the gel at rest; 0: far away.

    What the picture does not show of the gel is as at its border.
    """
    depth = maps if maps.ndim == 2 else np.ascontiguousarray(maps[..., 0])
    if not camera_height_mm or not (moved := np.abs(depth) > _FLAT_MM).any():
        return maps
    farthest_px = max(depth.shape) / 2 * float(np.abs(depth).max()) / camera_height_mm
    box = bounding_box(moved, margin=ceil(farthest_px) + 1)
    there = depth[box]
    for _ in range(_STEPS):
        there = _at(depth, _outwards(there, camera_height_mm), box)
    over = maps.copy()
    over[box] = there if maps.ndim == 2 else _at(maps, _outwards(there, camera_height_mm), box)
    return over


def _outwards(depth_mm: Floats, camera_height_mm: float) -> Floats:
    """Return by how much farther from the axis gel is seen than it is."""
    return np.asarray(1 / (1 - depth_mm / camera_height_mm), np.float32)


def _at(maps: Floats, share: Floats, box: Box) -> Floats:
    """Return maps in a box, where each pixel's way from the middle has `share` of its length."""
    y, x = (
        np.arange(*part.indices(size), dtype=np.float32) - np.float32((size - 1) / 2)
        for part, size in zip(box, maps.shape[:2], strict=True)
    )
    to_x = share * x + np.float32((maps.shape[1] - 1) / 2)
    to_y = share * y[:, None] + np.float32((maps.shape[0] - 1) / 2)
    return np.asarray(cv2.remap(maps, to_x, to_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
