"""What a calibration is worth on shapes it never saw: `python -m tests.benchmarks.objects BUNDLE [--sensor URL]`.

The ten benchmark objects are pressed into a simulated sensor and the error of each is printed. `--press-depth-mm`: how
deep; `--rezero`: with the untouched gel recorded anew before.
"""

import argparse
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import Camera
from gellight.opening import open_camera
from gellight.reconstruction.errors import SurfaceErrors, surface_errors

BALL = "BALL"
_SETTLE_FRAMES = 3
_REFERENCE_FRAMES = 30


def object_errors(
    source: str, url: str, press_depth_mm: float, *, geometry: Mapping[str, Any] | None = None, rezero: bool = False
) -> dict[str, SurfaceErrors]:
    """Press every object but the ball in the middle of the view and measure one frame of each; the errors by object.

    Camera and LEDs are set as they were when the bundle was made. rezero: the untouched gel is recorded anew before,
    nothing else of the bundle changes. Raises InputError for a sensor that knows no truth.
    """
    bundle = load_bundle(source)
    with open_camera(url, geometry=geometry or {}, bundle=bundle) as camera:
        if camera.stage is None:
            raise InputError(f"{url} cannot be judged: only a simulated sensor (sim://) knows what is pressed")
        camera.stage.take_over()
        for _ in range(_SETTLE_FRAMES):
            camera.read()
        reconstructor = Reconstructor(rezeroed(bundle, camera) if rezero else bundle)
        names = [name for name in camera.stage.objects if name != BALL]
        return {name: _one(camera, reconstructor, name, press_depth_mm) for name in names}


def rezeroed(bundle: Bundle, camera: Camera) -> Bundle:
    """Return the bundle with the untouched gel as the camera sees it now, and all else as it was."""
    untouched = np.mean([camera.read().image for _ in range(_REFERENCE_FRAMES)], axis=0)
    return bundle.with_reference(untouched, frames=_REFERENCE_FRAMES)


def _one(camera: Camera, reconstructor: Reconstructor, name: str, depth_mm: float) -> SurfaceErrors:
    camera.stage.press(name, depth_mm, 0.0, 0.0)
    frame = camera.read()
    assert frame.truth is not None
    return surface_errors(reconstructor.reconstruct(frame), frame.truth)


def mean_errors(errors: Iterable[SurfaceErrors]) -> SurfaceErrors:
    rows = [asdict(error) for error in errors]
    return SurfaceErrors(**{name: float(np.mean([row[name] for row in rows])) for name in rows[0]})


def main() -> None:
    parser = argparse.ArgumentParser("python -m tests.benchmarks.objects")
    parser.add_argument("bundle")
    parser.add_argument("--sensor", default="sim://")
    parser.add_argument("--press-depth-mm", type=float, default=0.3)
    parser.add_argument("--rezero", action="store_true")
    given = parser.parse_args()
    errors = object_errors(given.bundle, given.sensor, given.press_depth_mm, rezero=given.rezero)
    print(f"{'':10}{'normals °':>20}{'depth mm':>22}")
    print(f"{'object':10}{'whole':>10}{'contact':>10}{'whole':>11}{'contact':>11}")
    for name, row in {**errors, "mean": mean_errors(errors.values())}.items():
        angles = f"{row.normal_deg:10.3f}{row.contact_normal_deg:10.3f}"
        print(f"{name:10}{angles}{row.depth_mm:11.4f}{row.contact_depth_mm:11.4f}")


if __name__ == "__main__":
    main()
