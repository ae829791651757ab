"""The ten benchmark objects, pressed into a simulated sensor: what a calibration is worth on shapes never seen."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gellight.base.errors import CameraError, InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame
from gellight.opening import open_camera
from gellight.reconstruction.errors import SurfaceErrors, mean_errors, surface_errors
from gellight.reconstruction.pipeline import Reconstructor

BALL = "BALL"
_SETTLE_FRAMES = 3
_REFERENCE_FRAMES = 30
_ATTEMPTS = 20


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


def _lit_frame(camera: Camera, bundle: Bundle) -> CameraFrame:
    """A frame under the light of the bundle; a board that was kept waiting too long is dark, and lit again."""
    wanted = np.array([led.rgb for led in bundle.manifest.led], np.uint8)
    for _ in range(_ATTEMPTS):
        frame = camera.read()
        if frame.light is None or not len(wanted) or np.array_equal(frame.light, wanted):
            return frame
        camera.adopt(bundle.controls, bundle.colours)
    raise CameraError(f"{camera.url}: the LEDs do not keep the light of the calibration: see `gellight ring info`")


def rezeroed(bundle: Bundle, camera: Camera) -> Bundle:
    """Return the bundle with the untouched gel as the camera sees it now, and all else as it was."""
    untouched = np.mean([_lit_frame(camera, bundle).image for _ in range(_REFERENCE_FRAMES)], axis=0)
    return bundle.with_reference(untouched, frames=_REFERENCE_FRAMES)


def _one(camera: Camera, reconstructor: Reconstructor, name: str, depth_mm: float) -> ObjectError:
    assert camera.stage is not None
    camera.stage.press(name, depth_mm, 0.0, 0.0)
    frame = _lit_frame(camera, reconstructor.bundle)
    assert frame.truth is not None
    error = surface_errors(reconstructor.reconstruct(frame), frame.truth)
    return ObjectError(object_name=name, **asdict(error))


def summary(errors: list[ObjectError]) -> ObjectError:
    """Return the means over the objects."""
    return ObjectError(object_name="mean", **asdict(mean_errors(errors)))
