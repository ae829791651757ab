"""What `gellight calibrate lights` does: take pictures under each LED, and add the light of each to the bundle."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, CameraError
from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera
from gellight.lab.optics.lights.reference_light import ReferencePictures, light_model
from gellight.lab.optics.lights.ring_fit import RingFit, fit_ring
from gellight.opening import open_camera
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import write_lights
from gellight.photometric.ring_geometry import RingGeometry
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.sensor.lighting.hold import expose, ring_in_hand
from gellight.sensor.series_camera import EXPOSURE


def add_lights(
    bundle: Bundle,
    settings: Settings,
    out: Path,
    *,
    frames: int,
    overwrite: bool = False,
) -> dict[str, object]:
    """Measure the lights of the sensor that `settings` name, and write its bundle with them to `out`.

    Returns what was found, ready for JSON. Raises CameraError, BoardError, ConfigError or BundleError.
    """
    ring = RingGeometry.from_overrides(settings.geometry.overrides())
    colours = led_colours(bundle, ring)
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        bundle.check_fits(camera.url, camera.image_shape)
        with _untouched(camera):
            model = take_lights(camera, ring, colours, bundle.pixel_size_mm, frames)
    write_lights(bundle, model, out, overwrite=overwrite)
    return {"calibration": str(out)} | _facts(model, fit_ring(model, bundle.pixel_size_mm))


def _facts(model: LightModel, fit: RingFit) -> dict[str, object]:
    """What was found, ready for JSON."""
    return {
        "leds": len(model.colours),
        "gamma": model.gamma,
        "black_grey": model.black_grey.round(2).tolist(),
        "crosstalk": model.crosstalk.round(3).tolist(),
        "brightest_grey": round(model.brightest_grey, 1),
        "exposure_us": model.exposure_us,
        "pattern_residual": round(model.pattern_residual, 5),
        "ring_from_light": fit.as_json(),
    }


def led_colours(bundle: Bundle, ring: RingGeometry) -> NDArray[np.uint8]:
    """Return the (K, 3) colours of the LEDs: those the bundle was calibrated with, else full on as `ring` has them.

    Raises BundleError where the two disagree about which LED is of which colour.
    """
    if bundle.colours is None:
        return ring.colours
    found = "".join(led.colour for led in bundle.manifest.led)
    if found != ring.led_colours:
        raise BundleError(
            f"{bundle.source} is of a ring {found}, the settings say {ring.led_colours}: correct led_colours in "
            "[geometry]"
        )
    return bundle.colours


def take_lights(
    camera: Camera,
    ring: RingGeometry,
    colours: NDArray[np.uint8],
    pixel_size_mm: tuple[float, float],
    frames: int,
    taking: Callable[[int, int], object] = lambda index, groups: None,
) -> LightModel:
    """Show the gel, which nothing touches, dark, under each LED and under all, and make the light model of it.

    colours: (K, 3) uint8 of the LEDs. frames: averaged under each light. taking: told before each light, which it is
    and how many there are. Raises CameraError without a ring, and what `light_model` and `taking` raise.
    """
    if camera.ring is None:
        raise CameraError(f"{camera.url} has no light ring whose LEDs could be lit one by one: connect its board")
    if camera.stage:
        ring = replace(ring, window_mm=camera.stage.window_mm)
    pictures = _take_pictures(camera, colours, frames, taking)
    controls = camera.controls
    exposure = controls.read(EXPOSURE) if controls and EXPOSURE in controls.names() else None
    return light_model(pictures, ring, colours, pixel_size_mm, exposure_us=exposure)


@contextmanager
def _untouched(camera: Camera) -> Iterator[None]:
    """Lift off what a stage presses, and press it again, and nothing else, at the end."""
    stage = camera.stage
    if stage is None:
        yield
        return
    pressed = stage.status()
    stage.release()
    try:
        yield
    finally:
        stage.release()
        if pressed["object"]:
            stage.press(pressed["object"], pressed["depth_mm"], pressed["x_mm"], pressed["y_mm"])


def _take_pictures(
    camera: Camera, colours: NDArray[np.uint8], frames: int, taking: Callable[[int, int], object]
) -> ReferencePictures:
    """Average `frames` frames in the dark, under each LED, under each triple and under all."""
    singles, triples = single_leds(colours), colour_triples(colours)
    groups = [np.zeros_like(colours), *singles, *triples, colours]
    taken = []
    with ring_in_hand(camera):
        for index, group in enumerate(groups):
            taking(index, len(groups))
            images = [frame.image for frame in expose(camera, group, index, frames=frames)]
            # The dark by its median: noise that is cut off at 0 would lift the mean.
            taken.append(np.median(images, axis=0) if index == 0 else np.mean(images, axis=0))
    return ReferencePictures(
        dark=taken[0],
        singles=tuple(taken[1 : 1 + len(singles)]),
        triples=tuple(taken[1 + len(singles) : -1]),
        whole=taken[-1],
    )
