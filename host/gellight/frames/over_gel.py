"""Maps of the picture, laid over the gel at rest: what a camera from a height shows out of place.

A camera that seems to stand at the height H above the gel at rest shows the gel of the place x, d deep, in the pixel
p = x / (1 - d / H), both from its axis. So the depth over the gel is the fixed point of d = depth(x / (1 - d / H)).
"""

from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import bounding_box

Floats = NDArray[np.float32]
Box = tuple[slice, slice]
STEPS = 6
"""each is right to the share slope x / H of the one before, .4 at most where a slope of 1 lies in a corner"""
FLAT_MM = 0.02
"""gel less deep is taken to lie where it is seen: 7 micrometres beside it at most, 19 mm from the axis"""


def over_gel(maps: Floats, camera_height_mm: float) -> Floats:
    """Return maps (H, W) or (H, W, n), of which the first is the depth in mm, over the gel at rest; 0: far away.

    What the picture does not show of the gel is as at its border.
    """
    depth = maps if maps.ndim == 2 else np.ascontiguousarray(maps[..., 0])
    if not camera_height_mm or not (moved := np.abs(depth) > FLAT_MM).any():
        return maps
    farthest_px = max(depth.shape) / 2 * float(np.abs(depth).max()) / camera_height_mm
    box = bounding_box(moved, margin=ceil(farthest_px) + 1)
    there = depth[box]
    for _ in range(STEPS):
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
