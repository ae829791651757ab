"""The noise of a camera's pictures, such that limits on means over pixels hold.

Whatever looks for a touch compares means over n x n pixels with a multiple of their noise, and takes the noise to be
white: sigma / n. A camera that compresses (MJPG) leaves noise that its neighbours share: it blurs single pixels, whose
spread falls, and moves whole blocks of 8 x 8 together. Half a picture at rest would look touched.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.pixel_grid import block_means

SIDES_PX = (1, 4, 12)
"""of the squares over which limits are set on means"""


@dataclass(frozen=True, kw_only=True)
class ImageNoise:
    """How much pictures of a scene at rest differ from each other; grey levels."""

    pixel_grey: float
    """standard deviation of one pixel"""
    white_grey: float
    """standard deviation of white noise whose means over 4 x 4 or 12 x 12 pixels spread as much, where that is more"""


def measure_noise(images: Sequence[NDArray[np.uint8]], mean: NDArray[np.float32]) -> ImageNoise:
    """Measure the noise of at least two (H, W, 3) uint8 pictures of a scene at rest, given their mean.

    A change of all the light from picture to picture is drift and not noise: it is taken off before. Its mean is, for
    nothing touches: the median of some pixels is itself unsure by as much as the means whose spread is measured.
    """
    if len(images) < 2:
        raise ValueError(f"{len(images)} pictures: at least 2 are needed")
    squares = dict.fromkeys((side for side in SIDES_PX if side <= min(mean.shape[:2])), 0.0)
    for image in images:
        difference = image - mean
        difference -= difference.mean(axis=(0, 1))
        for side in squares:
            squares[side] += float(np.mean(block_means(difference, side) ** 2)) * side**2
    spread = {side: float(np.sqrt(total / (len(images) - 1))) for side, total in squares.items()}
    return ImageNoise(pixel_grey=spread[1], white_grey=max(spread.values()))
