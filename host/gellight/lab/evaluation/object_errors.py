"""The ten benchmark objects, pressed into a simulated sensor: what a calibration is worth on shapes never seen."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frames.camera import Camera
from gellight.opening import open_camera
from gellight.reconstruction.errors import SurfaceErrors, mean_errors, surface_errors
from gellight.reconstruction.pipeline import Reconstructor

BALL = "BALL"
_SETTLE_FRAMES = 3
_REFERENCE_FRAMES = 30


@dataclass(frozen=True, kw_only=True)
class ObjectError(SurfaceErrors):
    """The errors on one object, against the simulator's truth."""

    object_name: str


def object_errors(
    source: str, url: str, geometry: Mapping[str, Any], press_depth_mm: float, *, rezero: bool = False
) -> list[ObjectError]:
    """Press every object but the ball in the middle of the view and measure one frame of each.

    Camera and LEDs are set as they were when the bundle was made. rezero: the untouched gel is recorded anew before,
    nothing else of the bundle changes. Raises InputError for a sensor that knows no truth.
    """
    bundle = load_bundle(source)
    with open_camera(url, geometry=geometry, bundle=bundle) as camera:
        if camera.stage is None:
            raise InputError(f"{url} cannot be judged: only a simulated sensor (sim://) knows what is pressed")
        camera.stage.take_over()
        for _ in range(_SETTLE_FRAMES):
            camera.read()
        reconstructor = Reconstructor(rezeroed(bundle, camera) if rezero else bundle)
        names = [name for name in camera.stage.objects if name != BALL]
        return [_one(camera, reconstructor, name, press_depth_mm) for name in names]


def rezeroed(bundle: Bundle, camera: Camera) -> Bundle:
    """Return the bundle with the untouched gel as the camera sees it now, and all else as it was."""
    untouched = np.mean([camera.read().image for _ in range(_REFERENCE_FRAMES)], axis=0)
    return bundle.with_reference(untouched, frames=_REFERENCE_FRAMES)


def _one(camera: Camera, reconstructor: Reconstructor, name: str, depth_mm: float) -> ObjectError:
    assert camera.stage is not None
    camera.stage.press(name, depth_mm, 0.0, 0.0)
    frame = camera.read()
    assert frame.truth is not None
    error = surface_errors(reconstructor.reconstruct(frame), frame.truth)
    return ObjectError(object_name=name, **asdict(error))


def summary(errors: list[ObjectError]) -> ObjectError:
    """Return the means over the objects."""
    return ObjectError(object_name="mean", **asdict(mean_errors(errors)))
