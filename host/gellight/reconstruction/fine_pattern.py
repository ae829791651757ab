"""The fine pattern of a sensor: dust, pixels, the grain of its coating, by which one unit is told from another.

Light drifts and objects press, but what varies within two pixels stays where it is. Two pictures are compared by the
phase of their spectra in that band (a difference of Gaussians): pictures of one unit give a peak where they match,
those of two units none. On real sensors (docs/watch.md) the peak stands out of chance by 14 to 185 standard deviations,
also while the gel is pressed, and by at most 9 between units. Very smooth pictures, simulated ones among them, have
no such pattern.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

FINE_PX, COARSE_PX = 0.7, 2.0
"""standard deviations of the two Gaussians"""
REACH_PX = 20
"""by which a camera or its gel may have moved"""
SMALLEST_PX = 160
"""smaller pictures along one side leave too little chance to compare with"""
_DARKEST_GREY = 4.0  # chosen: in the logarithm, rounding of darker pixels would be a pattern
_MOST_SPREADS = 3.0
"""edges and scratches count no more than that many times the usual contrast"""
_SPREAD_TIMES = 1.5
"""of a normal distribution, per median of its absolute values"""
_GAP_PX = 8  # chosen: keeps a broad peak out of what counts as chance


class FinePattern:
    """The pattern in one picture, for comparison with others of its size."""

    def __init__(self, image: NDArray[Any]) -> None:
        """Take a (H, W, 3) picture, grey levels."""
        self._shape = image.shape[:2]
        self._spectrum = _spectrum(image)

    @property
    def large_enough(self) -> bool:
        """Whether the picture is large enough for `match` to mean something."""
        return min(int(size) for size in self._shape) >= SMALLEST_PX

    def match(self, image: NDArray[Any]) -> float:
        """Return by how many standard deviations the best match with a (H, W, 3) picture stands out of chance."""
        if image.shape[:2] != self._shape:
            raise ValueError(f"the picture is {image.shape}, the pattern {self._shape}")
        product = np.conj(self._spectrum) * _spectrum(image)
        size = np.abs(product)
        by_shift = np.fft.irfft2(product / np.maximum(size, np.median(size) + 1e-30), s=self._shape)
        by_shift = np.roll(by_shift, (REACH_PX, REACH_PX), axis=(0, 1))
        near, beyond = 2 * REACH_PX + 1, 2 * REACH_PX + _GAP_PX
        chance = np.concatenate([by_shift[beyond:-_GAP_PX].ravel(), by_shift[:, beyond:-_GAP_PX].ravel()])
        return float((by_shift[:near, :near].max() - chance.mean()) / max(float(chance.std()), 1e-30))


def pattern_match(images: Sequence[NDArray[Any]], reference: NDArray[Any]) -> float:
    """Return the median match of (H, W, 3) pictures of a unit with its reference image.

    0 where the pictures are too small to tell.
    """
    pattern = FinePattern(reference)
    if not pattern.large_enough or not images:
        return 0.0
    return float(np.median([pattern.match(image) for image in images]))


def _spectrum(image: NDArray[Any]) -> NDArray[np.complexfloating]:
    """The spectrum of what varies within two pixels, as a share of the light there."""
    from scipy import ndimage  # SciPy takes longer than all else of a start

    light = np.log(np.maximum(np.asarray(image, np.float32), _DARKEST_GREY)).mean(axis=2)
    fine = ndimage.gaussian_filter(light, FINE_PX) - ndimage.gaussian_filter(light, COARSE_PX)
    most = _MOST_SPREADS * _SPREAD_TIMES * float(np.median(np.abs(fine)))
    fine = np.clip(fine, -most, most)
    taper = np.outer(*(np.hanning(size).astype(np.float32) for size in fine.shape))
    return np.asarray(np.fft.rfft2((fine - fine.mean()) * taper))
