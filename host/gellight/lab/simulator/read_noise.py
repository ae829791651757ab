"""Read noise for a stream of frames: drawn once, and taken from other places in it for every row of every frame."""

import numpy as np
from numpy.typing import NDArray

from sim_reference.camera import WHITE

PLACES = 1 << 21
"""where the noise of a row may begin"""


class ReadNoise:
    """Digitises frames with Gaussian noise, white in space, and independent from frame to frame, shifted or not."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Draw with `rng`, once a picture is there."""
        self._rng = rng
        self._bank = np.zeros(0, np.float32)
        self._noisy = np.zeros(0, np.float32)

    def digitise(self, grey: NDArray[np.float32], noise_grey: float) -> NDArray[np.uint8]:
        """Add noise to grey levels, round and clip them: (H, W, 3) uint8; as `sim_reference.camera.digitise`."""
        rows, row_values = grey.shape[0], grey[0].size
        if self._noisy.shape != grey.shape:
            self._bank = self._rng.standard_normal(PLACES + row_values, dtype=np.float32)
            self._noisy = np.empty(grey.shape, np.float32)
        noisy, by_row = self._noisy, self._noisy.reshape(rows, row_values)
        starts: NDArray[np.int64] = self._rng.integers(PLACES, size=(rows,))
        for row, start in enumerate(starts):
            by_row[row] = self._bank[start : start + row_values]
        noisy *= np.float32(noise_grey)
        noisy += grey
        np.rint(noisy, out=noisy)
        return np.clip(noisy, 0, WHITE, out=noisy).astype(np.uint8)
