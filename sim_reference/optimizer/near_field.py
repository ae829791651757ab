"""The ring near the gel, as photometric stereo needs it: at each pixel, a light vector for each LED.

Equation 3 for a point of the gel with normal n is I = n . L with L = intensity times direction. All points are taken
to lie in the plane of the gel at rest: a press of 1 mm moves them by a twentieth of their distance to the LEDs.
Attached shadows are exact; cast shadows come from horizons at 24 azimuths.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from sim_reference.geometry import SensorGeometry, led_positions
from sim_reference.imaging import arriving_light
from sim_reference.metrics import angular_error, error_figures
from sim_reference.optimizer.benchmark import PressedObject
from sim_reference.optimizer.exposing import LightGroups, expose
from sim_reference.optimizer.shadows import horizon
from sim_reference.photometric_stereo import solve_normals
from sim_reference.refraction import VACUUM, Medium

Array = NDArray[np.float64]
HORIZONS = 24
MIN_LIGHT = 1e-9
"""of what an LED straight above gives: less is dark, and what follows would be rounding"""
HORIZON_REACH_MM = 8.0
SHADOW_SIGMAS = 3.0
"""observations up to this many standard deviations of the noise count as shadow"""


@dataclass(frozen=True, eq=False)
class Ring:
    """The light of each LED at P points of the gel."""

    vectors: Array
    """(K, P, 3) intensity times direction; the unit is that of `imaging.led_irradiance`"""
    azimuth_rad: Array
    """(K, P) of the light as seen from the point"""
    steepness: Array
    """(K, P) tangent of the light's elevation in the gel: a horizon that is higher shadows the point"""


@dataclass(frozen=True, eq=False)
class Scene:
    """A pressed object on the points where it is evaluated."""

    name: str
    index: int
    normals: Array
    """(P, 3)"""
    horizons: Array
    """(HORIZONS, P) tangents"""


def ring_light_vectors(geometry: SensorGeometry, x: Array, y: Array, medium: Medium = VACUUM) -> Ring:
    """Return the ring's light at the points x, y (P,) in mm; raises ValueError for LEDs inside the window."""
    lights = [_one_led(geometry, led, x, y, medium) for led in range(len(geometry.led_colours))]
    vectors, azimuth, steepness = (np.array(part) for part in zip(*lights, strict=True))
    return Ring(vectors, azimuth, steepness)


def _one_led(geometry: SensorGeometry, led: int, x: Array, y: Array, medium: Medium) -> tuple[Array, Array, Array]:
    led_x, led_y, height = led_positions(geometry)[led].tolist()
    to_x, to_y = led_x - x, led_y - y
    arriving, to_z = arriving_light(geometry, led, to_x, to_y, np.zeros_like(x), medium)
    vector = (height**2 * arriving)[:, None] * np.stack([to_x, to_y, to_z], axis=1)
    return vector, np.arctan2(-to_y, to_x) % (2 * pi), to_z / np.maximum(np.hypot(to_x, to_y), 1e-9)


def scene(pressed: PressedObject, points: NDArray[np.bool_]) -> Scene:
    """Return the truth at `points`, a mask (H, W), with the horizons around each."""
    depth = pressed.depth_mm.astype(np.float32)
    turns = 2 * pi * np.arange(HORIZONS) / HORIZONS
    horizons = np.array([horizon(depth, pressed.spacing_mm, turn, HORIZON_REACH_MM)[points] for turn in turns])
    return Scene(pressed.name, pressed.index, pressed.normals[points[pressed.region]], horizons)


def irradiance(seen: Scene, ring: Ring, *, cast_shadows: bool = True) -> Array:
    """Equation 3: (K, P) light of each LED on the pressed gel."""
    light = np.maximum(np.einsum("kpi,pi->kp", ring.vectors, seen.normals), 0)
    if cast_shadows:
        nearest = np.rint(ring.azimuth_rad / (2 * pi / HORIZONS)).astype(int) % HORIZONS
        light *= np.take_along_axis(seen.horizons, nearest, axis=0) < ring.steepness
    return np.asarray(light)


def mixing(geometry: SensorGeometry, *, one_shot: bool) -> Array:
    """Return which LEDs make up each picture, (pictures, K): one a colour, or every LED by itself."""
    if not one_shot:
        return np.eye(len(geometry.led_colours))
    return np.array([[float(colour == channel) for colour in geometry.led_colours] for channel in "RGB"])


def restoring_gain(ring: Ring, pictures: Array) -> float:
    """Return the exposure at which the brightest pixel of the gel at rest has full scale in one of the pictures.

    Raises ValueError if the ring leaves the gel dark.
    """
    brightest = float((pictures @ ring.vectors[..., 2]).max())
    if not brightest > MIN_LIGHT:
        raise ValueError("no LED lights the gel: correct ring_radius_mm, incident_angle_deg or beam_angle_deg")
    return 1 / brightest


def normal_error(
    seen: Scene,
    ring: Ring,
    pictures: Array,
    camera: LightGroups,
    *,
    drop_shadows: bool = False,
    gain: float | None = None,
) -> tuple[float, float, float]:
    """Return MAE, Top5, Top1 in rad of the normals that the `pictures` (pictures, K) of the ring give.

    `gain` is the exposure in full scales per irradiance, by default `restoring_gain`. With `drop_shadows`,
    observations within three sigma of black are left out.
    """
    vectors = np.einsum("ck,kpi->cpi", pictures, ring.vectors)
    gain = restoring_gain(ring, pictures) if gain is None else gain
    light = pictures @ irradiance(seen, ring, cast_shadows=camera.cast_shadows) * gain
    images = np.array([expose(level, camera, (seen.index, number)) for number, level in enumerate(light)])
    level = SHADOW_SIGMAS * camera.noise_grey if drop_shadows else None
    found = solve_normals(images[:, None, :], vectors[:, None] * gain * camera.full_scale_grey, level)[0]
    return error_figures(np.where(images.any(axis=0), angular_error(found, seen.normals), pi / 2))
