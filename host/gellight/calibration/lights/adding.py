"""What `gellight calibrate lights` puts together: a camera with its ring, and the bundle that learns the lights."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError
from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.calibration.lights.ring_fit import RingFit, fit_ring
from gellight.calibration.lights.taking import Progress, take_lights
from gellight.opening import open_camera
from gellight.reconstruction.photometric.light_model import LightModel
from gellight.reconstruction.photometric.lights_file import write_lights
from gellight.reconstruction.photometric.ring_geometry import RingGeometry


def add_lights(
    settings: Settings,
    out: Path,
    *,
    frames: int,
    ring_from_light: bool = False,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> dict[str, object]:
    """Measure the lights of the sensor and write the bundle, both as `settings` name them, with them to `out`.

    ring_from_light: take the geometry of the ring from the pictures, not from the settings.
    Returns what was found, ready for JSON. Raises CameraError, BoardError, ConfigError or BundleError.
    """
    bundle = load_bundle(settings.sensor.calibration)
    ring = RingGeometry.from_overrides(settings.geometry.overrides())
    colours = led_colours(bundle, ring)
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        if camera.image_shape != bundle.image_shape:
            raise BundleError(
                f"{camera.url} delivers {camera.image_shape[1]}x{camera.image_shape[0]} pixels, the calibration "
                f"{bundle.source} is for {bundle.image_shape[1]}x{bundle.image_shape[0]}: choose the bundle of "
                "this sensor"
            )
        model = take_lights(camera, ring, colours, bundle.pixel_size_mm, frames=frames, progress=progress)
    fit = fit_ring(model, bundle.pixel_size_mm)
    if ring_from_light:
        model = replace(model, ring=fit.ring)
    write_lights(bundle, model, out, overwrite=overwrite)
    return {"calibration": str(out), "ring_used": "light" if ring_from_light else "settings"} | _facts(model, fit)


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
    if not bundle.manifest.led:
        return ring.colours
    found = "".join(led.colour for led in bundle.manifest.led)
    if found != ring.led_colours:
        raise BundleError(
            f"{bundle.source} is of a ring {found}, the settings say {ring.led_colours}: correct led_colours in "
            "[geometry]"
        )
    return np.array([led.rgb for led in bundle.manifest.led], np.uint8)
