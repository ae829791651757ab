"""What makes the error of wide, flat touches: `python -m tests.benchmarks.flat_touch`.

Presses of the finite-element gel are photographed and felt as they are, without cast shadows, with true slopes in the
place of the network's, and with a zero by the gel that surely rests. Beside the depth's error in contact stands by how
much the gel's deepest place lies below the nominal press: the coating rounds edges, and the gel does not follow them.
What labels of balls alone do, `tests.benchmarks.prisms` says.
"""

from collections.abc import Iterator
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.simulator.scene import Press, Scene
from gellight.reconstruction.integration import integrate
from sim_reference import imaging
from sim_reference.camera import CameraResponse, digitise
from sim_reference.deformation import Deformation
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import Surface
from tests.helpers.fem_presses import SPACING_MM, depth_mm

NAMES = ("ball4_1.0", "prism_0.5", "prism_0.9", "punch_0.4", "punch_0.8", "cyl_1.0", "tstep_0.5")
CONTACT_SHARE, REST_MM = 0.5, 0.002
"""of the deepest place: surely in contact; and what surely rests"""


def photographed(name: str) -> tuple[CameraFrame, Surface]:
    """Return a picture with noise, and the surface in it."""
    depth = depth_mm(name)
    deformed = Deformation(depth.astype(float), np.maximum(depth, 0), SPACING_MM)
    scene = Scene(SensorGeometry(), CameraResponse(noise_grey=1.0), model=lambda *_: deformed)
    grey, surface = scene.show(Press("BALL", 0.5, 1.0, -2.0))
    image = digitise(grey, 1.0, np.random.default_rng(0))
    return CameraFrame(image=image, time_s=0.0, sequence=0, source=name), surface


def ways(name: str, path: Reconstructor) -> Iterator[tuple[str, NDArray[np.floating], Surface]]:
    """Yield what is left out, the depth that is felt then, and the true surface."""
    frame, surface = photographed(name)
    felt = path.reconstruct(frame).depth_mm
    yield "as it is", felt, surface
    with patch.object(imaging, "visibility", lambda depth, *_: np.ones_like(depth)):
        yield "no cast shadows", path.reconstruct(photographed(name)[0]).depth_mm, surface
    yield "true slopes", integrate(surface.gradient_map, path.bundle.pixel_size_mm), surface
    yield "zero by resting gel", felt - np.median(felt[surface.depth_mm < REST_MM]), surface


def main() -> None:
    """Print a line for each press and way."""
    path = Reconstructor(load_bundle("synthetic"))
    for name in NAMES:
        short = float(name.split("_")[1]) - float(depth_mm(name).max())
        print(f"{name}: the gel's deepest place is {short:+.3f} mm short of the press")
        for what, depth, surface in ways(name, path):
            left = (depth - surface.depth_mm)[surface.depth_mm > CONTACT_SHARE * surface.depth_mm.max()]
            shape = np.abs(left - left.mean()).mean()
            print(f"  {what:20} error {np.abs(left).mean():.4f} mm, level {left.mean():+.4f}, shape {shape:.4f}")


if __name__ == "__main__":
    main()
