"""How far each pixel of a frame is to be believed: its slope, its light, its grey levels.

A network is right where it has learnt. A slope beyond the steepest of its presses is a guess; so is one where a colour
has lost its light, because the surface turns away from those LEDs or something shades it (attached and cast shadow);
and where the camera shows its largest value. docs/calibration-data.md says by how much errors grow there.

The integration takes no weights from it: docs/calibration-data.md has the figures.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.frames.measures import CLIPPED, DARK, STEEP, Confidence

DARK_SHARE = 0.1
"""of the light at rest: less than that in one channel is shadow"""
DARKEST_GREY = 16.0
"""a channel that is darker than that at rest says nothing of shadow"""
CLIPPED_GREY = 254
CLIPPED_VALUE = 0.5
LEAST_VALUE = 0.05
TRAINED_QUANTILE = 0.999
"""of the slopes that a network has learnt, is the steepest: single pixels beyond are mislabelled"""


def confidence_of(
    image: NDArray[np.uint8],
    reference: NDArray[np.float32],
    gradient_map: NDArray[np.float32],
    steepest: float | None,
) -> Confidence:
    """Judge the pixels of a frame.

    image: (H, W, 3) RGB. reference: the same of the untouched gel. gradient_map: (H, W, 2). steepest: slope that the
    network has learnt; None where nobody knows.
    """
    lit = np.where(reference >= DARKEST_GREY, image / np.maximum(reference, DARKEST_GREY), 1.0).min(axis=2)
    clipped = image.max(axis=2) >= CLIPPED_GREY
    value = np.minimum(lit / DARK_SHARE, 1.0)
    flags = np.where(lit < DARK_SHARE, DARK, 0) | np.where(clipped, CLIPPED, 0)
    value *= np.where(clipped, CLIPPED_VALUE, 1.0)
    if steepest is not None:
        slope = np.hypot(gradient_map[..., 0], gradient_map[..., 1])
        flags |= np.where(slope > steepest, STEEP, 0)
        value *= np.minimum(steepest / np.maximum(slope, steepest), 1.0) ** 2
    return Confidence(value=np.maximum(value, LEAST_VALUE).astype(np.float32), quality_flags=flags.astype(np.uint8))


def steepest_of(slopes: NDArray[np.floating]) -> float:
    """Return the steepest slope that a network has learnt from (N, 2) slopes, a few mislabelled ones left out."""
    return float(np.quantile(np.hypot(slopes[:, 0], slopes[:, 1]), TRAINED_QUANTILE))
