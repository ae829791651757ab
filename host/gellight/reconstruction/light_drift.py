"""Light that drifts between the reference image and a frame: how much, and a difference image without it.

LEDs fade as they warm up, supplies sag, exposure hunts. All of it changes the whole picture, a touch only a part of it.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
STEP_PX = 4
"""every fourth pixel of every fourth row is enough for a median"""


def difference_of(image: NDArray[np.uint8], reference: Floats, *, follow_light: bool) -> Floats:
    """Return the (H, W, 3) difference image, grey levels; with `follow_light` the drift of the light is taken off."""
    difference = np.subtract(image, reference, dtype=np.float32)
    if follow_light:
        difference -= light_drift(difference)
    return difference


def light_drift(difference: Floats) -> Floats:
    """Return the (3,) change of light in a (H, W, 3) difference image, grey levels: the median over the view.

    It is the light's as long as less than half of the view is touched; beyond that the touch itself is taken for it.
    """
    return _median(difference[::STEP_PX, ::STEP_PX])


def drift_of(image: NDArray[np.uint8], reference: Floats) -> Floats:
    """Return the (3,) `light_drift` without the whole difference image."""
    sample = slice(None, None, STEP_PX)
    return _median(np.subtract(image[sample, sample], reference[sample, sample], dtype=np.float32))


def _median(sample: Floats) -> Floats:
    return np.median(sample.reshape(-1, 3), axis=0).astype(np.float32)
