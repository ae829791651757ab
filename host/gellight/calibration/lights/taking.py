"""Take the pictures of the untouched gel that the light model is made of."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError
from gellight.calibration.lights.reference_light import ReferencePictures, light_model
from gellight.frames.camera import Camera
from gellight.reconstruction.photometric.light_model import LightModel
from gellight.reconstruction.photometric.ring_geometry import RingGeometry
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.sensor.lighting.hold import Hold
from gellight.sensor.series_cameras import EXPOSURE

FRAMES = 8
Progress = Callable[[int, int], None]


def take_lights(
    camera: Camera,
    ring: RingGeometry,
    colours: NDArray[np.uint8],
    pixel_size_mm: tuple[float, float],
    *,
    frames: int = FRAMES,
    progress: Progress = lambda done, total: None,
) -> LightModel:
    """Show the untouched gel dark, under each LED and under all, and make the light model of what the camera sees.

    colours: (K, 3) uint8 of the LEDs. A simulated sensor lifts off what is pressed, and presses it again afterwards.
    Raises CameraError without a ring, and what `light_model` raises.
    """
    if camera.ring is None:
        raise CameraError(f"{camera.url} has no light ring whose LEDs could be lit one by one: connect its board")
    with _untouched(camera):
        pictures = _take_pictures(camera, colours, frames, progress)
    controls = camera.controls
    exposure = controls.read(EXPOSURE) if controls and EXPOSURE in controls.names() else None
    return light_model(pictures, ring, colours, pixel_size_mm, exposure_us=exposure)


@contextmanager
def _untouched(camera: Camera) -> Iterator[None]:
    """Lift off what a stage presses, and press it again."""
    stage = camera.stage
    pressed = stage.status() if stage else {}
    if stage:
        stage.release()
    try:
        yield
    finally:
        if stage and pressed["object"]:
            stage.press(*(pressed[name] for name in ("object", "depth_mm", "x_mm", "y_mm")))  # type: ignore[arg-type]


def _take_pictures(camera: Camera, colours: NDArray[np.uint8], frames: int, progress: Progress) -> ReferencePictures:
    """Average `frames` frames in the dark, under each LED, under each triple and under all."""
    singles, triples = single_leds(colours), colour_triples(colours)
    groups = [np.zeros_like(colours), *singles, *triples, colours]
    taken = []
    with Hold(camera) as hold:
        for index, group in enumerate(groups):
            images = [frame.image for frame in hold.expose(group, index, frames)]
            # The dark by its median: noise that is cut off at 0 would lift the mean.
            taken.append(np.median(images, axis=0) if index == 0 else np.mean(images, axis=0))
            progress(index + 1, len(groups))
    return ReferencePictures(
        dark=taken[0],
        singles=tuple(taken[1 : 1 + len(singles)]),
        triples=tuple(taken[1 + len(singles) : -1]),
        whole=taken[-1],
    )
