"""Read noise for a stream of frames: drawn once, and taken from another place in it for every frame."""

import numpy as np
from numpy.typing import NDArray

from sim_reference.camera import WHITE

SPARE = 1 << 20
"""places where the noise of a frame may begin; two frames begin at the same one in a million"""


class ReadNoise:
    """Digitises frames with Gaussian noise, white in space, and independent from frame to frame at each pixel."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Draw with `rng`, once a picture is there."""
        self._rng = rng
        self._bank = np.zeros(0, np.float32)
        self._noisy = np.zeros(0, np.float32)

    def digitise(self, grey: NDArray[np.float32], noise_grey: float) -> NDArray[np.uint8]:
        """Add noise to grey levels, round and clip them: (H, W, 3) uint8; as `sim_reference.camera.digitise`."""
        if self._noisy.shape != grey.shape:
            self._bank = self._rng.standard_normal(grey.size + SPARE, dtype=np.float32)
            self._noisy = np.empty(grey.shape, np.float32)
        start, noisy = int(self._rng.integers(SPARE)), self._noisy
        np.multiply(self._bank[start : start + grey.size].reshape(grey.shape), np.float32(noise_grey), out=noisy)
        noisy += grey
        np.rint(noisy, out=noisy)
        return np.clip(noisy, 0, WHITE, out=noisy).astype(np.uint8)
