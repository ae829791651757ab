"""The presses of tests/data/fem, as depth, as a picture of the simulated sensor, and their force."""

import numpy as np

from gellight.frames.frames import CameraFrame
from gellight.lab.simulator.scene import Press, Scene
from sim_reference.camera import CameraResponse, digitise
from sim_reference.deformation import Deformation
from sim_reference.geometry import AS_BUILT
from tests.helpers.places import CHECKOUT

_KEPT = np.load(CHECKOUT / "tests/data/fem/presses.npz")
NAMES = [name.removesuffix("_force_n") for name in _KEPT.files if name.endswith("_force_n")]
SPACING_MM = float(_KEPT["spacing_mm"])


def depth_mm(name: str) -> np.ndarray:
    """(n, n), points `SPACING_MM` apart."""
    return _KEPT[f"{name}_depth"] * np.float32(_KEPT["depth_unit_mm"])


def force_n(name: str) -> float:
    return float(_KEPT[f"{name}_force_n"])


def picture(name: str, *, seed: int = 0) -> CameraFrame:
    """The press a little beside the middle of the simulated sensor's view, with noise."""
    deformed = Deformation(depth_mm(name).astype(float), np.maximum(depth_mm(name), 0), SPACING_MM)
    scene = Scene(AS_BUILT, CameraResponse(noise_grey=1.0), model=lambda *_: deformed)
    image = digitise(scene.show(Press("BALL", 0.5, 1.0, -2.0))[0], 1.0, np.random.default_rng(seed))
    return CameraFrame(image=image, time_s=0.0, sequence=0, source=name)
