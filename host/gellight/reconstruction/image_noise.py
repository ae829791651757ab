"""How pictures of the gel at rest differ from its reference image: noise of the camera, and what noise is not.

A touch is found by comparing means over n x n pixels with a multiple of their noise, sigma / n for white noise. The
noise of a camera that compresses (MJPG) is not white: single pixels are blurred, so that they spread less, and whole
blocks of 8 x 8 pixels change together. With the sigma of single pixels half a picture at rest would look touched. Nor
is it normal: most blocks stay as they are and few jump by a whole step of the compression, so limits go by what is
rare, too.

The rest is no noise: light that drifts unevenly since the reference image was taken, gel that does not come back quite.
It is the same in neighbouring pixels, so no mean makes it smaller. On real sensors it is larger than
the noise of a mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import block_means

SIDES_PX = (1, 4, 8, 12)
"""of the squares over which limits are set on means, and of the blocks of a JPEG"""
RARE, RARE_TIMES = 1e-4, 4.594
"""white noise of three channels together exceeds so many of its standard deviations in this share of the means: the
quantile of chi with three degrees of freedom"""
LEAST_RARE = 7
"""means beyond that are needed to tell where it lies"""
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
    """standard deviation of white noise whose means over squares of `SIDES_PX` spread as much, or stray as far once in
    ten thousand, where that is more"""


def measure_noise(images: Sequence[NDArray[np.uint8]], mean: NDArray[np.float32]) -> ImageNoise:
    """Measure the noise of at least two (H, W, 3) uint8 pictures of a scene at rest, given their mean.

    A change of all the light from picture to picture is drift and not noise, so the mean change of each channel is
    taken off first. The mean serves because nothing touches the gel; a median over a part of the pixels would be as
    noisy as the means whose spread is measured.
    """
    if len(images) < 2:
        raise ValueError(f"{len(images)} pictures: at least 2 are needed")
    sides = [side for side in SIDES_PX if side <= min(mean.shape[:2])]
    spread = dict.fromkeys(sides, 0.0)
    together: dict[int, list[NDArray[np.float32]]] = {side: [] for side in sides[1:]}
    for image in images:
        difference = image - mean
        difference -= difference.mean(axis=(0, 1))
        for side in sides:
            squares = block_means(difference, side) ** 2 * side**2
            spread[side] += float(squares.mean()) / len(images)
            if side > 1:
                together[side].append(squares.sum(axis=2).ravel())
    own = len(images) / (len(images) - 1)  # the mean follows the pictures that it is of
    far = [_far(np.concatenate(squares)) for squares in together.values()]
    white = max(*spread.values(), *far)
    return ImageNoise(pixel_grey=float(np.sqrt(own * spread[1])), white_grey=float(np.sqrt(own * white)))


def _far(squares: NDArray[np.float32]) -> float:
    """Return the variance of white noise that strays as far as these sums of three squares; 0 if too few tell it."""
    count = int(RARE * len(squares))
    return float(np.partition(squares, -count)[-count]) / RARE_TIMES**2 if count >= LEAST_RARE else 0.0


def noise_of_one(image: NDArray[np.floating]) -> float:
    """Estimate the noise of one pixel, grey levels, from a single (H, W, 3) picture of at least 8 x 10 pixels.

    Second differences along the rows, (1, -2, 1), have 6 times the variance of white noise. Their mean square over
    blocks of 8 x 8 pixels is no whole number, and the median over the blocks leaves edges and scratches out; fixed
    texture of the gel raises it. The answer is never below the rounding of the picture to whole grey levels.
    """
    second = image[:, :-2] - 2 * image[:, 1:-1] + image[:, 2:]
    variance = np.median(block_means(np.asarray(second, np.float32) ** 2, _TEXTURE_PX)) / 6
    return max(float(np.sqrt(variance)), _ROUNDING_GREY)
