"""How far each pixel of a frame is to be believed: its slope, its place, its colour, its light, its grey levels.

A network is right where it has learnt. A slope beyond the steepest of its presses is a guess; so is one far from every
press, or of a colour that none of them had. Real sensors that learnt from one half of the picture were off by 1.3 to
2.7 times as much in the other. A guess, too, is where a colour has lost its light, because the surface turns away from
those LEDs or something shades it (attached and cast shadow), and where the camera shows its largest value.
docs/calibration-data.md says by how much errors grow there.

The integration takes no weights from it: docs/calibration-data.md has the figures.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.frames.measures import CLIPPED, DARK, ELSEWHERE, STEEP, STRANGE, Confidence

Bools = NDArray[np.bool_]

DARK_SHARE = 0.1
"""of the light at rest: less than that in one channel is shadow"""
DARKEST_GREY = 16.0
"""a channel that is darker than that at rest says nothing of shadow"""
CLIPPED_GREY = 254
DOUBTED_VALUE = 0.5
"""of pixels that are clipped, elsewhere or strange, for each of these"""
LEAST_VALUE = 0.05
TRAINED_QUANTILE = 0.999
"""of the slopes that a network has learnt, is the steepest: single pixels beyond are mislabelled"""
NEAR = 0.1
"""share of the shorter side of the picture: at this distance from a press, or nearer, its light is known"""
_BIN_GREY, _BINS = 8, 64
"""colours are counted in cubes of this side; one that touches a cube that was learnt is known"""


@dataclass(frozen=True, eq=False)
class Learnt:
    """What a network has learnt from."""

    steepest: float
    """slope"""
    near: Bools
    """(H, W) pixels of the picture near a press"""
    colours: Bools
    """(64, 64, 64) cubes of the change of red, green and blue that presses had, and those beside them"""

    @classmethod
    def of_rows(cls, rows: NDArray[np.floating], image_shape: tuple[int, int]) -> Self:
        """Take the (N, 7) rows of `presses.npz`: changes of the colours, x, y in px, slopes."""
        pressed, colours = np.zeros(image_shape, np.bool_), np.zeros((_BINS, _BINS, _BINS), np.bool_)
        row, column = (np.clip(rows[:, k].round().astype(int), 0, image_shape[4 - k] - 1) for k in (4, 3))
        pressed[row, column] = True
        colours[_cubes(rows[:, :3])] = True
        away = ndimage.distance_transform_edt(~pressed)
        around = ndimage.binary_dilation(colours, np.ones((3, 3, 3)))
        return cls(steepest_of(rows[:, 5:7]), np.asarray(away <= NEAR * min(image_shape)), np.asarray(around))

    def strange(self, difference: NDArray[np.floating]) -> Bools:
        """Mark the (H, W) pixels of a (H, W, 3) difference image whose colour no press had."""
        return ~self.colours[_cubes(difference)]


def _cubes(change: NDArray[np.floating]) -> tuple[NDArray[np.intp], ...]:
    """Return the indices of the cubes of (..., 3) changes of colour, grey levels."""
    cubes = np.clip(change // _BIN_GREY + _BINS // 2, 0, _BINS - 1).astype(np.intp)
    return tuple(np.moveaxis(cubes, -1, 0))


def confidence_of(
    image: NDArray[np.uint8],
    reference: NDArray[np.float32],
    gradient_map: NDArray[np.float32],
    learnt: Learnt | None,
) -> Confidence:
    """Judge the pixels of a frame.

    image: (H, W, 3) RGB. reference: the same of the untouched gel. gradient_map: (H, W, 2). learnt: by the network;
    None where nobody knows, or slopes are measured.
    """
    lit = np.where(reference >= DARKEST_GREY, image / np.maximum(reference, DARKEST_GREY), 1.0).min(axis=2)
    value = np.minimum(lit / DARK_SHARE, 1.0)
    flagged = {DARK: lit < DARK_SHARE, CLIPPED: image.max(axis=2) >= CLIPPED_GREY}
    if learnt is not None:
        slope = np.hypot(gradient_map[..., 0], gradient_map[..., 1])
        flagged |= {STEEP: slope > learnt.steepest, ELSEWHERE: ~learnt.near, STRANGE: learnt.strange(image - reference)}
        value *= np.minimum(learnt.steepest / np.maximum(slope, learnt.steepest), 1.0) ** 2
    flags = np.zeros(lit.shape, np.uint8)
    for flag, where in flagged.items():
        flags[where] |= flag
        if flag not in (DARK, STEEP):
            value[where] *= DOUBTED_VALUE
    return Confidence(value=np.maximum(value, LEAST_VALUE).astype(np.float32), quality_flags=flags)


def steepest_of(slopes: NDArray[np.floating]) -> float:
    """Return the steepest slope that a network has learnt from (N, 2) slopes, a few mislabelled ones left out."""
    return float(np.quantile(np.hypot(slopes[:, 0], slopes[:, 1]), TRAINED_QUANTILE))
