"""How pictures of the gel at rest differ from its reference image: noise of the camera, and what noise is not.

A touch is found by comparing means over n x n pixels with a multiple of their noise, sigma / n for white noise. The
noise of a camera that compresses (MJPG) is not white: single pixels are blurred, so that they spread less, and whole
blocks of 8 x 8 pixels change together. With the sigma of single pixels half a picture at rest would look touched.

The rest is no noise: light that drifts unevenly since the reference image was taken, gel that does not come back quite.
It is the same in neighbouring pixels, so no mean makes it smaller. On real sensors it is larger than
the noise of a mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import block_means

SIDES_PX = (1, 4, 12)
"""of the squares over which limits are set on means"""
SIGNIFICANT = 6.5
"""standard deviations of the noise of a mean beyond which a change counts, the three channels together, as the root of
their squares: noise alone does that once in 280 million means"""
_LARGEST = 0.57
"""share that the largest of three channels always has in the root of their squares"""
REST_TIMES = 4.0
"""and multiples of what the gel at rest differs by: that is bounded, and not drawn anew in every cell and frame"""
_ROUNDING_GREY = float(np.sqrt(1 / 12))
"""rounding to whole grey levels adds this to the noise of a camera that is otherwise quiet"""
_TEXTURE_PX = 8
"""side of the blocks of which the typical one gives the noise of a single picture"""


@dataclass(frozen=True)
class RestChange:
    """By how much pictures of the gel at rest differ from the reference image; grey levels."""

    noise_grey: float
    """standard deviation of one pixel"""
    rest_grey: float = 0.0
    """root mean square of what means over cells differ by beyond that noise"""

    def __post_init__(self) -> None:
        """Refuse NaN and what is below 0."""
        if not (self.noise_grey >= 0 and self.rest_grey >= 0):
            raise ValueError(f"noise_grey {self.noise_grey}, rest_grey {self.rest_grey} out of range")

    @property
    def pixel_grey(self) -> float:
        """Standard deviation of one pixel, with the rounding to whole grey levels."""
        return float(np.hypot(self.noise_grey, _ROUNDING_GREY))

    def limits_grey(self, side_px: int, significant: float = SIGNIFICANT) -> tuple[float, float]:
        """Return what the change of a mean over `side_px` x `side_px` pixels exceeds where the gel is touched.

        The root of the squares of its three channels exceeds the first, `significant` standard deviations of its noise,
        and the largest of them the second, which the gel at rest decides.
        """
        noise = significant * self.pixel_grey / side_px
        return noise, float(np.hypot(_LARGEST * noise, REST_TIMES * self.rest_grey))


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


def noise_of_one(image: NDArray[np.floating]) -> float:
    """Estimate the noise of one pixel, grey levels, from a single (H, W, 3) picture of at least 8 x 10 pixels.

    Second differences along the rows, (1, -2, 1), have 6 times the variance of white noise. Their mean square over
    blocks of 8 x 8 pixels is no whole number, and the median over the blocks leaves edges and scratches out; fixed
    texture of the gel raises it. The answer is never below the rounding of the picture to whole grey levels.
    """
    second = image[:, :-2] - 2 * image[:, 1:-1] + image[:, 2:]
    variance = np.median(block_means(np.asarray(second, np.float32) ** 2, _TEXTURE_PX)) / 6
    return max(float(np.sqrt(variance)), _ROUNDING_GREY)
