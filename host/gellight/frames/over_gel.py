"""Maps of the picture, laid over the gel at rest: what a camera from a height shows out of place.

A camera that seems to stand at the height H above the gel at rest shows the gel of the place x, d deep, in the pixel
p = x / (1 - d / H), both from its axis. So the depth over the gel is the fixed point of d = depth(x / (1 - d / H)).
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
STEPS = 6
"""each is right to the share slope x / H of the one before, .4 at most where a slope of 1 lies in a corner"""


def over_gel(maps: Floats, camera_height_mm: float) -> Floats:
    """Return maps (H, W) or (H, W, n), of which the first is the depth in mm, over the gel at rest; 0: far away.

    What the picture does not show of the gel is as at its border.
    """
    if not camera_height_mm:
        return maps
    depth = maps if maps.ndim == 2 else np.ascontiguousarray(maps[..., 0])
    there = depth
    for _ in range(STEPS):
        there = _at(depth, _outwards(there, camera_height_mm))
    return there if maps.ndim == 2 else _at(maps, _outwards(there, camera_height_mm))


def _outwards(depth_mm: Floats, camera_height_mm: float) -> Floats:
    """Return by how much farther from the axis gel is seen than it is."""
    return np.asarray(1 / (1 - depth_mm / camera_height_mm), np.float32)


def _at(maps: Floats, share: Floats) -> Floats:
    """Return maps where each pixel's way from the middle has `share` (H, W) of its length."""
    height, width = share.shape
    middle_x, middle_y = (width - 1) / 2, (height - 1) / 2
    x = np.arange(width, dtype=np.float32) - np.float32(middle_x)
    y = np.arange(height, dtype=np.float32) - np.float32(middle_y)
    to_x, to_y = share * x + np.float32(middle_x), share * y[:, None] + np.float32(middle_y)
    return np.asarray(cv2.remap(maps, to_x, to_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
