"""Did the scene rest while its exposures were taken? Two answers, each blind where the other sees.

Repetition: the first light is shown again at the end, and must show the same picture. Sees any lasting change between
first and last exposure, and nothing that came back meanwhile.

Misfit: twelve lights overdetermine three unknowns, so exposures of different scenes do not fit one surface. Sees a
scene that moved and returned.

Both look at means of 8 x 8 pixels: least squares is linear, so means of signals fit means of normals as well as the
pixels themselves, with an eighth of the noise.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import block_means, plane_means
from gellight.photometric.light_model import Bools, Floats

BLOCK_PX = 8  # chosen: the noise of such means is an eighth
LIMIT_DEVIATIONS = 7.0
"""of the noise of a block's mean: of 14400 blocks one passes it by chance in 10^8 series"""
MODEL_ERROR = 0.02
"""share of the signal by which near-field model and block means may be wrong on a scene at rest"""
MOVED_BLOCKS = 8
"""this many blocks have to misfit: what moves is larger, a steep edge is smaller"""


def change_of_repetition(first: NDArray[np.uint8], last: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the change of each block between two (H, W, 3) pictures under one light, (h, w) grey levels.

    It is that of the channel that changed most. The median over the view is taken off first: the light itself may have
    changed, which is no motion.
    """
    change = block_means(last, BLOCK_PX) - block_means(first, BLOCK_PX)
    change -= np.median(change.reshape(-1, 3), axis=0)
    return np.asarray(np.abs(change).max(axis=2))


def repetition_limit(noise_grey: float) -> float:
    """Return the change of a block, grey levels, from which on it is no noise."""
    return float(LIMIT_DEVIATIONS * np.sqrt(2 * (noise_grey**2 + 1 / 12)) / BLOCK_PX)


def misfit(
    signals: Floats, valid: Bools, predicted: Floats, deviation: NDArray[np.float64], shape: tuple[int, int]
) -> float:
    """Return by how much blocks of signals (K, P) differ from their prediction, 1 being the limit.

    It is that of the block which is worst but for seven others. Only blocks that every light reached are judged: at the
    edge of a shadow a mean is of two scenes.
    """
    lights = len(signals)
    whole = plane_means(valid.reshape(lights, *shape).astype(np.float32), BLOCK_PX).min(axis=0) == 1
    wrong = np.abs(plane_means((signals - predicted).reshape(lights, *shape), BLOCK_PX))
    level = plane_means(predicted.reshape(lights, *shape), BLOCK_PX)
    allowed = LIMIT_DEVIATIONS * deviation[:, None, None] / BLOCK_PX + MODEL_ERROR * np.abs(level)
    worst = np.sort((wrong / allowed)[:, whole].max(axis=0, initial=0.0))
    return float(worst[-MOVED_BLOCKS]) if len(worst) >= MOVED_BLOCKS else 0.0
