"""How far each pixel of a frame is to be believed: its slope, its place, its colour, its light, its grey levels.

A network is right where it has learnt. A slope beyond the steepest of its presses is a guess; so is one far from every
press, or of a colour that none of them had. Real sensors that learnt from one half of the picture were off by 1.3 to
2.7 times as much in the other. A guess, too, is where a colour has lost its light, because the surface turns away from
those LEDs or something shades it (attached and cast shadow), and where the camera shows its largest value.
docs/figures.md says by how much errors grow there.

The integration takes no weights from it: docs/figures.md has the figures.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.frames.measures import CLIPPED, DARK, ELSEWHERE, STEEP, STRANGE, Confidence
from gellight.photometric.light_model import CLIPPED_GREY

Bools = NDArray[np.bool_]

DARK_SHARE = 0.1
"""of the light at rest: less than that in one channel is shadow"""
DARKEST_GREY = 16.0
"""a channel that is darker than that at rest says nothing of shadow"""
DOUBTED_VALUE = 0.5
"""of pixels that are clipped, elsewhere or strange, for each of these"""
LEAST_VALUE = 0.05  # chosen: who weighs by it never divides by 0; recordings promise it
TRAINED_QUANTILE = 0.999
"""of the slopes that a network has learnt, is the steepest: single pixels beyond are mislabelled"""
NEAR = 0.1
"""share of the shorter side of the picture: at this distance from a press, or nearer, its light is known"""
_BIN_GREY, _BINS = 8, 64
"""colours are counted in cubes of this side; one that touches a cube that was learnt is known"""
_PLACES = np.array([[_BINS * _BINS, _BINS, 1]], np.float32)
"""of red, green and blue in the flat index of a cube"""
_DOUBTED = np.array([DOUBTED_VALUE ** (flags & (CLIPPED | ELSEWHERE | STRANGE)).bit_count() for flags in range(256)],
                    np.float32)  # fmt: skip
"""what each combination of flags leaves of a value"""
_SURELY_GENTLER = 0.9999
"""of a square: whatever the rounding, what is less has the smaller root"""


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
        colours.ravel()[_cubes(rows[:, :3])] = True
        away = cv2.distanceTransform((~pressed).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        along = cv2.dilate(colours.view(np.uint8), np.ones((3, 3), np.uint8)).reshape(-1, _BINS)
        around = cv2.dilate(along, np.ones((1, 3), np.uint8)).reshape(colours.shape)
        return cls(steepest_of(rows[:, 5:7]), np.asarray(away <= NEAR * min(image_shape)), around.view(np.bool_))

    def strange(self, difference: NDArray[np.floating]) -> Bools:
        """Mark the (H, W) pixels of a (H, W, 3) difference image whose colour no press had."""
        return np.asarray(~self.colours.take(_cubes(difference)))


def _cubes(change: NDArray[np.floating]) -> NDArray[np.intp]:
    """Return (...) flat indices of the cubes of (..., 3) changes of colour, grey levels."""
    cubes = np.multiply(change, 1 / _BIN_GREY, dtype=np.float32)
    np.floor(cubes, out=cubes)
    cubes += _BINS // 2
    np.clip(cubes, 0, _BINS - 1, out=cubes)
    flat = cv2.transform(cubes.reshape(-1, 1, 3), _PLACES) if cubes.size else cubes
    return flat.astype(np.intp).reshape(cubes.shape[:-1])


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
    channels = _planes(image)
    lit = reduce(np.minimum, map(_lit, channels, _planes(reference)))
    value = np.minimum(lit / DARK_SHARE, 1.0)
    flagged = {DARK: lit < DARK_SHARE, CLIPPED: reduce(np.maximum, channels) >= CLIPPED_GREY}
    if learnt is not None:
        flagged |= {ELSEWHERE: ~learnt.near, STRANGE: learnt.strange(image - reference)}
    flags = reduce(np.bitwise_or, [where.view(np.uint8) * np.uint8(flag) for flag, where in flagged.items()])
    value *= cv2.LUT(flags, _DOUBTED)
    if learnt is not None:
        _doubt_steep(value, flags, gradient_map, learnt.steepest)
    return Confidence(value=np.maximum(value, np.float32(LEAST_VALUE)), quality_flags=flags)


def _planes(image: NDArray[Any]) -> Sequence[NDArray[Any]]:
    """Return the (H, W) channels of a (H, W, n) image: each at once is several times as fast as all of a pixel."""
    return cv2.split(np.ascontiguousarray(image))


def _lit(channel: NDArray[np.uint8], at_rest: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the light of each pixel as a share of that at rest, 1 where there is none at rest."""
    share = channel / np.maximum(at_rest, DARKEST_GREY)
    np.copyto(share, 1, where=at_rest < DARKEST_GREY)
    return np.asarray(share)


def _doubt_steep(
    value: NDArray[np.floating], flags: NDArray[np.uint8], gradient_map: NDArray[np.float32], steepest: float
) -> None:
    """Lower the values of what is steeper than that, and flag it."""
    x, y = (plane.ravel() for plane in _planes(gradient_map))
    perhaps = np.flatnonzero(~(x * x + y * y < _SURELY_GENTLER * steepest**2))  # few; a root takes its time
    slope = np.hypot(x[perhaps], y[perhaps])
    flags.ravel()[perhaps] |= (slope > steepest).view(np.uint8) * np.uint8(STEEP)
    value.ravel()[perhaps] *= np.minimum(steepest / np.maximum(slope, steepest), 1.0) ** 2


def steepest_of(slopes: NDArray[np.floating]) -> float:
    """Return the steepest slope that a network has learnt from (N, 2) slopes, a few mislabelled ones left out."""
    return float(np.quantile(np.hypot(slopes[:, 0], slopes[:, 1]), TRAINED_QUANTILE))
