"""A picture of a map while it grows: heights in colours, with a scale, and what the gel did not reach."""

import numpy as np
from numpy.typing import NDArray

from gellight.lab.report.pictures import depth_picture, encode_png, round_step
from gellight.lab.scanning.fusion import Fused

WIDEST_PX = 1600
NOT_REACHED, NOT_SEEN = (70, 74, 84), (20, 22, 28)
SCALE_INK = (228, 230, 235)
CLIPPED = (1.0, 99.0)
"""per cent of the heights between which the colours lie"""
BAR_PX, MARGIN_PX = 6, 14


def map_picture(fused: Fused) -> bytes:
    """Return a PNG: heights from dark to bright, grey where a press saw but did not reach, a bar of round length.

    The bar lies at the lower left; how long it is, and over which heights the colours go, `in_words` says.
    """
    height = fused.height_map.height_mm
    step = max(1, -(-max(height.shape) // WIDEST_PX))
    height, seen = height[::step, ::step], fused.seen[::step, ::step]
    low, high = _range(height)
    picture = depth_picture(np.nan_to_num(height - low), scale_um=max(high - low, 1e-4) * 1e3)
    picture[np.isnan(height)] = NOT_REACHED
    picture[~seen] = NOT_SEEN
    return encode_png(_with_bar(picture, bar_mm(fused) / (fused.height_map.pixel_mm * step)))


def bar_mm(fused: Fused) -> float:
    """Return how long the bar is: a round length, a fifth to half of the width."""
    return round_step(fused.height_map.height_mm.shape[1] * fused.height_map.pixel_mm, 5)


def heights_um(fused: Fused) -> tuple[float, float]:
    """Return the heights of the darkest and the brightest colour."""
    low, high = _range(fused.height_map.height_mm)
    return low * 1e3, high * 1e3


def _range(height: NDArray[np.float32]) -> tuple[float, float]:
    known = height[np.isfinite(height)]
    low, high = np.percentile(known, CLIPPED) if len(known) else (0.0, 1.0)
    return float(low), float(high)


def _with_bar(picture: NDArray[np.uint8], length_px: float) -> NDArray[np.uint8]:
    """Return the picture with a strip below it that has the bar."""
    strip = np.full((3 * MARGIN_PX, *picture.shape[1:]), NOT_SEEN, np.uint8)
    strip[MARGIN_PX : MARGIN_PX + BAR_PX, MARGIN_PX : MARGIN_PX + max(1, round(length_px))] = SCALE_INK
    return np.concatenate([picture, strip])
