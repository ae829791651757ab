"""Whether a picture is of the unit that a bundle was made with: another unit feels up to 80 degrees wrong.

Two things are compared with the reference image, and neither minds drift of the light or a touch:

- the fine pattern (`reconstruction.fine_pattern`), where the calibration found that this unit has one;
- the light: its course over the view, by medians over cells, after a gain of each channel was taken off.

On pictures of real sensors, pressed and with drifted light, the colours of one unit differ by up to 2.7 degrees and the
light by 8 % in the median; of units of different make by 9.5 degrees and 54 % or more. Two white ones of one make
differ by 0.4 degrees and 4 %, and only the pattern tells them apart.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle
from gellight.reconstruction.fine_pattern import FinePattern
from gellight.watch.cells import Cells, cell_means

CERTAIN_MATCH = 14.0
"""a unit whose own pictures match worse is not judged by its pattern"""
LOST_SHARE, LOST_MATCH = 0.5, 10.0
"""of its own match, and in all: a worse match is another unit's"""
OTHER_COLOUR_DEG, OTHER_LIGHT = 8.0, 0.4
"""medians over the view; both must be exceeded. A wavy plate 0.8 mm deep over the whole view makes 7 degrees, 33 %"""
DARKEST_GAIN = 0.2  # chosen: with less light, or five times as much, nothing can be compared
_DARKEST_GREY = 2.0  # chosen: the logarithm of darker cells would be that of their rounding


@dataclass(frozen=True, kw_only=True)
class UnitFigures:
    """How a picture compares with the reference image of a bundle."""

    colour_deg: float
    """median angle between the colours, as vectors of red, green and blue"""
    light_share: float
    """median change of the light beyond a gain of each channel, as a share"""
    gain: float
    """median of the light as a share of what it was, of the channel that changed most"""
    pattern: float | None
    """match of the fine pattern; None where the bundle does not say that its unit has one"""
    own_pattern: float | None
    """the same of the pictures of the calibration"""

    @property
    def reason(self) -> str:
        """Why it is another unit; empty where it may be the same."""
        if not DARKEST_GAIN <= self.gain <= 1 / DARKEST_GAIN:
            return ""  # the light is off, or another one: nothing can be compared
        if self.pattern is not None and self.own_pattern is not None:
            if self.pattern < min(LOST_SHARE * self.own_pattern, LOST_MATCH):
                return (
                    f"dust, pixels and coating make another fine pattern (match {self.pattern:.1f}, pictures of the "
                    f"calibration {self.own_pattern:.1f}, chance up to {LOST_MATCH:g})"
                )
            if self.pattern >= CERTAIN_MATCH:
                return ""
        if self.colour_deg > OTHER_COLOUR_DEG and self.light_share > OTHER_LIGHT:
            return (
                f"colours differ by {self.colour_deg:.0f} degrees, the light by {self.light_share:.0%}, in the median"
            )
        return ""

    def as_json(self) -> dict[str, object]:
        """Return the figures, rounded for people."""
        return {name: None if value is None else round(value, 3) for name, value in vars(self).items()}


class UnitCheck:
    """Compares pictures with the reference image of one bundle."""

    def __init__(self, bundle: Bundle) -> None:
        """Take the reference image; some hundredths of a second."""
        self._source = bundle.source
        self._cells = cell_means(bundle.reference)
        own = bundle.metrics.get("pattern_match")
        self._own = float(own) if own is not None and float(own) >= CERTAIN_MATCH else None
        self._pattern = FinePattern(bundle.reference) if self._own is not None else None

    def figures(self, image: NDArray[np.uint8]) -> UnitFigures:
        """Compare a (H, W, 3) picture that was taken under the light of the bundle; some hundredths of a second."""
        pattern = self._pattern.match(image) if self._pattern else None
        return _compared(self._cells, cell_means(image), pattern, self._own)

    def refuse(self, image: NDArray[np.uint8]) -> None:
        """Raise BundleError, with the measured reason, where a picture is of another unit."""
        if reason := self.figures(image).reason:
            raise BundleError(
                f"{self._source} was made with another unit: {reason}; nothing was replaced; calibrate this sensor, or "
                "give the bundle of this one"
            )


def _compared(reference: Cells, now: Cells, pattern: float | None, own_pattern: float | None) -> UnitFigures:
    """Return the figures of the light, by (h, w, 3) cells, with those of the pattern."""
    change = np.log(np.maximum(now, _DARKEST_GREY) / np.maximum(reference, _DARKEST_GREY))
    gain = np.median(change, axis=(0, 1))
    levelled = now / np.exp(gain)
    lengths = np.linalg.norm(reference, axis=2) * np.linalg.norm(levelled, axis=2)
    cosine = (reference * levelled).sum(axis=2) / np.maximum(lengths, 1e-9)
    return UnitFigures(
        colour_deg=float(np.median(np.degrees(np.arccos(np.clip(cosine, -1, 1))))),
        light_share=float(np.median(np.abs(change - gain).max(axis=2))),
        gain=float(np.exp(gain[np.abs(gain).argmax()])),
        pattern=pattern,
        own_pattern=own_pattern,
    )
