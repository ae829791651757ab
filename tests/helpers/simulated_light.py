"""The light of a simulated ring LED by LED, as its simulator tells it: along parallel rays, and behind a window."""

from dataclasses import replace

import numpy as np

from gellight.frames.pixel_grid import plane_means
from gellight.reconstruction.led_light import LedLight
from sim_reference.camera import CameraResponse
from sim_reference.geometry import SensorGeometry, led_axes, led_positions
from sim_reference.imaging import led_irradiance, ring_light
from sim_reference.surface import untouched

PARALLEL = replace(SensorGeometry(), perspective=False, window=False)
WHOLE = replace(PARALLEL, perspective=True, window=True)
WORLDS = PARALLEL, WHOLE


def simulated_light(geometry: SensorGeometry, side: int) -> LedLight:
    """Return that of a geometry on squares of `side` pixels."""
    light, flat = ring_light(geometry), untouched(geometry)
    alone = plane_means(np.stack([led_irradiance(flat, geometry, led) for led in range(len(light))]), side)
    seen = (light @ np.array(CameraResponse().crosstalk).T)[:, :, None, None] * alone[:, None]
    return LedLight(
        leds=np.hstack([led_positions(geometry), led_axes(geometry)]).astype(np.float32),
        exponent=geometry.emission_exponent,
        shares=(seen / seen.sum(axis=0)).astype(np.float32),
        black=np.zeros(3, np.float32),
        gamma=1.0,
        window_mm=geometry.window_mm if geometry.window else 0.0,
    )
