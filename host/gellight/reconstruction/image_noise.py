"""The noise of a camera's pictures, measured so that limits on means over pixels hold.

A touch is found by comparing means over n x n pixels with a multiple of their noise, sigma / n for white noise. The
noise of a camera that compresses (MJPG) is not white: single pixels are blurred, so that they spread less, and whole
blocks of 8 x 8 pixels change together. With the sigma of single pixels half a picture at rest would look touched.
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

    A change of all the light from picture to picture is drift and not noise, so the mean change of each channel is
    taken off first. The mean serves because nothing touches the gel; a median over a part of the pixels would be as
    noisy as the means whose spread is measured.
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
