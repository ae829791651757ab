"""What the simulated error in contact is made of: `python -m tests.benchmarks.error_sources [BUNDLE] [--objects]`.

The ball 2 mm deep at random places, or with `--objects` the ten objects 0.3 mm deep, felt as they are and with one
source of error after the other taken away. Mean error of the normals and of the depth in contact; of the normals also
at the rim, within 0.3 mm of where the contact ends, and inside. The bundle has to be of a sensor whose LEDs are even.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.numpy_path import NumpyPath
from gellight.frame_path.pipeline import Form, Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.synthetic import ball_presses
from gellight.reconstruction.integration import angle_deg, normals
from sim_reference import imaging
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import BENCHMARK_NAMES
from sim_reference.surface import Surface

SEED, BALLS, BALL_MM, OBJECT_MM = 3, 6, 2.0, 0.3
RIM_MM = 0.3
Floats = NDArray[np.floating]
Felt = tuple[Floats, Floats]
"""(H, W, 2) slopes and (H, W) depth, mm"""
Feel = Callable[[Floats, Surface], Felt]


def presses(objects: bool) -> list[Press]:
    """Return what is pressed."""
    if objects:
        return [Press(name, OBJECT_MM) for name in BENCHMARK_NAMES]
    return list(ball_presses(SensorGeometry(), BALLS, np.random.default_rng(SEED), BALL_MM))


def felt_by(path: Reconstructor, noise_grey: float) -> Feel:
    """Return what a frame path feels in a picture with this noise."""

    def feel(grey: Floats, _: Surface) -> Felt:
        image = digitise(grey.astype(np.float32), noise_grey, np.random.default_rng(SEED))
        found = path.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0, source="sim"))
        return found.gradient_map, found.depth_mm

    return feel


def by_true_slopes(path: Reconstructor) -> Feel:
    """Return what the frame path makes of true slopes, in the place of the network's."""
    as_it_is = felt_by(path, 1.0)

    def feel(grey: Floats, surface: Surface) -> Felt:
        slopes = surface.gradient_map.astype(np.float32)
        with patch.object(NumpyPath, "_slopes", lambda *_: slopes.copy()):
            return as_it_is(grey, surface)

    return feel


def ways(bundle: Bundle) -> Iterator[tuple[str, Feel, bool, float | None]]:
    """Yield what is taken away, what feels then, whether LEDs cast shadows, and the coating's smoothing, mm."""
    path, unlit = Reconstructor(bundle), Reconstructor(bundle, cast_shadows=False)
    numpy_path = Reconstructor(bundle, cast_shadows=False, form=Form.CELLS)
    rough = Reconstructor(bundle, smoothing_px=1, form=Form.PIXELS)
    as_it_looks = replace(bundle, manifest=bundle.manifest.model_copy(update={"light_by_depth": False}))
    yield "as it is", felt_by(path, 1.0), True, None
    yield "light of depth left in", felt_by(Reconstructor(as_it_looks), 1.0), True, None
    yield "shadows not searched for", felt_by(unlit, 1.0), True, None
    yield "no shadows", felt_by(unlit, 1.0), False, None
    yield "no noise", felt_by(path, 0.0), True, None
    yield "no noise, no shadows", felt_by(unlit, 0.0), False, None
    yield "no noise, not smoothed", felt_by(rough, 0.0), True, None
    yield "no coating", felt_by(path, 1.0), True, 0.0
    yield "true slopes", by_true_slopes(numpy_path), True, None


def errors(feel: Feel, scene: Scene, light: NDArray[np.float64], pressed: list[Press]) -> NDArray[np.float64]:
    """Return the means over presses: normals in contact, at its rim and inside, degrees; depth, mm."""
    found = []
    for press in pressed:
        grey, surface = scene.show(press, light)
        slopes, depth_mm = feel(grey, surface)
        angle = angle_deg(normals(slopes), normals(surface.gradient_map))
        inside = ndimage.binary_erosion(surface.contact, iterations=round(RIM_MM / scene.geometry.pixel_size_mm))
        off_mm = np.abs(depth_mm - surface.depth_mm)[surface.contact].mean()
        parts = [angle[part].mean() if part.any() else np.nan for part in (surface.contact & ~inside, inside)]
        found.append([angle[surface.contact].mean(), *parts, off_mm])
    return np.asarray(np.nanmean(found, axis=0))


def main() -> None:
    """Print a line for each source of error."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.error_sources", description=__doc__)
    parser.add_argument("bundle", nargs="?", default="synthetic")
    parser.add_argument("--objects", action="store_true")
    given = parser.parse_args()
    bundle, pressed = load_bundle(given.bundle), presses(given.objects)
    light = bundle.colours / 255
    print(f"{'':26}{'contact':>9}{'rim':>9}{'inside':>9}{'depth':>10}")
    for name, feel, shadows, coating in ways(bundle):
        geometry = SensorGeometry() if coating is None else SensorGeometry(coating_smoothing_mm=coating)
        seen = imaging.visibility if shadows else lambda depth, *_: np.ones_like(depth)
        with patch.object(imaging, "visibility", seen):
            row = errors(feel, Scene(geometry, CameraResponse()), light, pressed)
        print(f"{name:26}{row[0]:8.3f}°{row[1]:8.3f}°{row[2]:8.3f}°{row[3]:8.4f} mm", flush=True)


if __name__ == "__main__":
    main()
