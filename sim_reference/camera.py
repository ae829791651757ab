"""The camera: from light on the gel to grey levels.

    grey = 255 * (exposure * C E)^(1 / gamma) + noise,  rounded and clipped to 0..255

with the irradiance E of the three colours and the crosstalk matrix C of the camera's colour filters.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WHITE = 255


@dataclass(frozen=True, kw_only=True)
class CameraResponse:
    """The response of a camera to light. The defaults are a machine-vision camera with an RGB filter mosaic."""

    exposure: float = 1.0
    """grey level per irradiance, as a share of white"""
    crosstalk: tuple[tuple[float, float, float], ...] = ((0.90, 0.08, 0.02), (0.06, 0.88, 0.06), (0.02, 0.08, 0.90))
    """share of each LED colour (columns) in each channel (rows); filters of cameras overlap by about a tenth"""
    gamma: float = 1.0
    noise_grey: float = 1.0
    """standard deviation of the read noise before quantisation, grey levels"""

    def __post_init__(self) -> None:
        """Refuse what no camera has."""
        if not (self.exposure > 0 and self.gamma > 0 and self.noise_grey >= 0):
            raise ValueError(f"exposure {self.exposure} and gamma {self.gamma} must be positive, noise not negative")


def linear_grey(irradiance: Array, response: CameraResponse) -> Array:
    """(H, W, 3) irradiance -> (H, W, 3) grey levels before noise, rounding and clipping."""
    light = irradiance @ np.array(response.crosstalk).T * response.exposure
    shaped = light if response.gamma == 1 else light ** (1 / response.gamma)
    return np.asarray(WHITE * shaped)


def expose(irradiance: Array, response: CameraResponse, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Take one picture: (H, W, 3) irradiance -> (H, W, 3) uint8."""
    return digitise(linear_grey(irradiance, response).astype(np.float32), response.noise_grey, rng)


def digitise(grey: NDArray[np.float32], noise_grey: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Add read noise to grey levels, round and clip them: (H, W, 3) uint8."""
    noisy = rng.standard_normal(grey.shape, dtype=np.float32)
    noisy *= noise_grey
    noisy += grey
    np.rint(noisy, out=noisy)
    return np.clip(noisy, 0, WHITE, out=noisy).astype(np.uint8)


def exposure_for(irradiance: Array, response: CameraResponse, brightest_grey: float) -> float:
    """Return the exposure that gives the brightest pixel under `irradiance` the level `brightest_grey`."""
    brightest = float((irradiance @ np.array(response.crosstalk).T).max())
    return float((brightest_grey / WHITE) ** response.gamma / brightest)
