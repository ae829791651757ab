"""Objects that barely touch the simulated sensor, as its camera sees them."""

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import CameraFrame
from gellight.lab.simulator.scene import Scene
from sim_reference import gel
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.deformation import NO_OBJECT, grid
from sim_reference.geometry import AS_BUILT
from sim_reference.imaging import ring_irradiance
from sim_reference.surface import Surface, sample

Array = NDArray[np.float64]
NOISE_GREY = 1.0
SPACING_MM, GRID_SIZE = 0.0625, 512
_AT = grid(GRID_SIZE, SPACING_MM)
_away_mm = np.hypot(_AT[None, :], _AT[:, None])


def ball(radius_mm: float) -> Array:
    """Height of a ball, mm, 0 at its highest point."""
    return np.where(_away_mm < radius_mm, np.sqrt(np.maximum(radius_mm**2 - _away_mm**2, 0)) - radius_mm, NO_OBJECT)


def flat_punch(radius_mm: float) -> Array:
    """Height of the flat end of a cylinder."""
    return np.where(_away_mm < radius_mm, 0.0, NO_OBJECT)


class LightTouches:
    """The simulated sensor."""

    def __init__(self) -> None:
        """Expose it."""
        self.scene = Scene(AS_BUILT, CameraResponse(noise_grey=NOISE_GREY))
        self.untouched, _ = self.scene.show(None)

    def press(self, height_mm: Array, depth_um: float, place_mm: tuple[float, float]) -> Surface:
        """Return the gel under an object with its highest point so deep in it."""
        pressed = gel.press(height_mm, SPACING_MM, depth_um * 1e-3, self.scene.geometry)
        return sample(pressed, self.scene.geometry, *place_mm)

    def grey(self, surface: Surface) -> NDArray[np.float32]:
        """Return (H, W, 3) what the camera sees, without noise."""
        irradiance = ring_irradiance(surface, self.scene.geometry, self.scene.light)
        return linear_grey(irradiance, self.scene.response).astype(np.float32)

    def picture(self, grey: NDArray[np.float32], random: np.random.Generator) -> CameraFrame:
        """Return the camera frame, with noise."""
        return CameraFrame(image=digitise(grey, NOISE_GREY, random), time_s=0.0, sequence=0)
