"""Where the LEDs shine from, found in the pictures of the untouched gel themselves.

How the light of an LED falls off over the flat gel depends on where it stands: E = cos^m h / d^3 in its own distance d,
height h and emission. What all LEDs have in common (tint, dirt, vignetting) and how bright each one is cancels in
logarithms. Radius, height, tilt, beam angle and the middle of the ring are then found by least squares. This assumes
that the LEDs shine as cos^m and the coating is Lambertian; `misfit` tells how far the pictures bear that out.
"""

from dataclasses import dataclass, replace
from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gellight.frames.pixel_grid import gel_points_mm
from gellight.photometric.light_model import LightGroups, LightModel
from gellight.photometric.ring_geometry import RingGeometry
from gellight.photometric.solver import Points, light_rows, light_through

Array = NDArray[np.float64]
LEAST_LIGHT = 1e-15
"""of an LED that turns away: its logarithm is sought"""
STEP_PX = 16
"""patterns are smooth: they are compared on a coarse grid"""
FREE = ("ring_radius_mm", "height_mm", "incident_angle_rad", "beam_angle_rad", "centre_x_mm", "centre_y_mm")
# Chosen: wider than any ring that can be built, in the order of FREE, mm and rad.
LOWER, UPPER = (1.0, 1.0, 0.0, 0.35, -10.0, -10.0), (200.0, 200.0, 1.4, 3.1, 10.0, 10.0)


@dataclass(frozen=True, kw_only=True)
class RingFit:
    """A ring whose light falls off as that of the pictures."""

    ring: RingGeometry
    misfit: float
    """root mean square of what is left of the light, as a share of it"""

    def as_json(self) -> dict[str, float]:
        """Return the figures, rounded for people, angles in degrees."""
        return {
            "ring_radius_mm": round(self.ring.ring_radius_mm, 3),
            "height_mm": round(self.ring.height_mm, 3),
            "incident_angle_deg": round(degrees(self.ring.incident_angle_rad), 2),
            "beam_angle_deg": round(degrees(self.ring.beam_angle_rad), 2),
            "centre_x_mm": round(self.ring.centre_x_mm, 3),
            "centre_y_mm": round(self.ring.centre_y_mm, 3),
            "misfit": round(self.misfit, 5),
        }


def fit_ring(model: LightModel, pixel_size_mm: tuple[float, float]) -> RingFit:
    """Find the ring whose light is most like that of the model, beginning with the model's own ring."""
    measured = own_light(np.log(model.references(LightGroups.SINGLES)[:, ::STEP_PX, ::STEP_PX]))
    x, y = coarse_points(model.image_shape, pixel_size_mm)

    def wrong(values: Array) -> Array:
        light = flat_light(x, y, _with(model.ring, values)).reshape(measured.shape)
        return np.asarray((own_light(np.log(light)) - measured).ravel())

    lower = np.array(LOWER)
    lower[FREE.index("height_mm")] += model.ring.window_mm
    start = np.clip([getattr(model.ring, name) for name in FREE], lower, UPPER)
    found = least_squares(wrong, start, bounds=(lower, UPPER), x_scale=(10, 10, 0.5, 1, 1, 1))
    return RingFit(ring=_with(model.ring, found.x), misfit=float(np.sqrt((found.fun**2).mean())))


def _with(ring: RingGeometry, values: Array) -> RingGeometry:
    """The ring with other values of `FREE`; the camera stays where it is, the LEDs move."""
    given: dict[str, Any] = dict(zip(FREE, (float(value) for value in values), strict=True))
    height = given.pop("height_mm")
    return replace(ring, mounting_height_mm=ring.camera_height_mm - height, **given)


def coarse_points(image_shape: tuple[int, int], pixel_size_mm: tuple[float, float]) -> tuple[Array, Array]:
    """x and y in mm of every 16th pixel of every 16th row."""
    x, y = np.moveaxis(gel_points_mm(image_shape, pixel_size_mm)[::STEP_PX, ::STEP_PX], 2, 0).reshape(2, -1)
    return x, y


def flat_light(x_mm: Array, y_mm: Array, ring: RingGeometry) -> Array:
    """(K, N) light of each LED on the flat gel at N points, equally bright LEDs, arbitrary unit."""
    points = Points(x_mm, y_mm, np.zeros_like(x_mm))
    if ring.window_mm:
        leds = zip(ring.positions_mm().tolist(), ring.axes().tolist(), strict=True)
        parts = [light_through(points, *led, ring.emission_exponent, ring.window_mm) for led in leds]
        return np.array([np.maximum(brought * above, LEAST_LIGHT) for brought, above in parts])
    # With references of 1 a row on the flat gel is the vector to the LED in units of its height.
    to_light = light_rows(points, np.ones((len(ring.channels), len(x_mm))), ring)
    squared = (to_light[:, 0] ** 2 + to_light[:, 1] ** 2 + 1) * ring.height_mm**2
    leaving = -np.einsum("kip,ki->kp", to_light, ring.axes()) * ring.height_mm
    cosine = np.maximum(leaving, 1e-9) / np.sqrt(squared)
    return np.asarray(cosine**ring.emission_exponent / squared**1.5)


def own_light(logs: Array) -> Array:
    """(K, h, w) logarithms without what all LEDs have in common and without the brightness of each."""
    own = logs - logs.mean(axis=0)
    return np.asarray(own - own.mean(axis=(1, 2), keepdims=True))
