"""The paper's fine stage: how well normals are found at each mounting height."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight_design.studies import StudySetup
from gellight_design.sweep import Study, Task
from sim_reference.geometry import SensorGeometry
from sim_reference.metrics import error_figures
from sim_reference.optimizer import design, fine, near_field
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.refraction import VACUUM, Medium, window_of

Array = NDArray[np.float64]
FINE_DIAMETER_MM = 30.0
"""of the disc that the fine study evaluates at most"""
CAMERA = LightGroups(full_scale_grey=230.0)
METHODS = {
    "one exposure": (True, False),
    "each LED by itself": (False, False),
    "each LED by itself, shadows dropped": (False, True),
}
"""whether all LEDs shine at once, whether shadowed observations are dropped"""
EQUAL_LIGHT = "one exposure, least possible error"
"""of an unbiased estimate, lamps and exposure those of the given sensor at every height"""
FINE_THINNING = 6
"""one in that many pixels is evaluated"""


def fine_errors(name: str, setup: StudySetup, heights_mm: tuple[float, ...], medium: Medium) -> Any:
    """Return MAE and Top1 in rad by method, `EQUAL_LIGHT` last, and height: (methods + 1, heights, 2) as lists.

    They are NaN at a height where the LEDs would be inside the window.
    """
    diameter = min(FINE_DIAMETER_MM, setup.sampling.region_diameter_mm)
    place = setup.press(name, replace(setup.sampling, region_diameter_mm=diameter), FINE_THINNING)
    camera, given = setup.with_noise(CAMERA), near_field.ring_light_vectors(setup.geometry, place.x, place.y, medium)
    h_mm = setup.geometry.camera_height_mm - setup.geometry.mounting_height_mm
    # The unit of light is that of an LED straight above, which falls with the square of its height.
    gain = near_field.restoring_gain(given, near_field.mixing(setup.geometry, one_shot=True)) * h_mm**2
    by_height = [
        _errors_at(fine.at_height(setup.geometry, height), place, medium, camera, gain) for height in heights_mm
    ]
    return np.swapaxes(by_height, 0, 1).tolist()


def _errors_at(
    geometry: SensorGeometry, place: design.Place, medium: Medium, camera: LightGroups, gain_mm2: float
) -> Array:
    """Return MAE and Top1 in rad of each method, and of `EQUAL_LIGHT`: (methods + 1, 2)."""
    above_mm = geometry.camera_height_mm - geometry.mounting_height_mm
    if above_mm <= medium.thickness_mm:
        return np.full((len(METHODS) + 1, 2), np.nan)
    ring = near_field.ring_light_vectors(geometry, place.x, place.y, medium)
    mixed = [(near_field.mixing(geometry, one_shot=at_once), drop) for at_once, drop in METHODS.values()]
    errors = [near_field.normal_error(place.scenes[0], ring, mix, camera, drop_shadows=drop) for mix, drop in mixed]
    at_once = near_field.mixing(geometry, one_shot=True)
    errors.append(least_error(place.scenes[0], ring, at_once, camera, gain=gain_mm2 / above_mm**2))
    return np.array([[mae, top1] for mae, _, top1 in errors])


def least_error(
    seen: near_field.Scene, ring: near_field.Ring, pictures: Array, camera: LightGroups, *, gain: float
) -> tuple[float, float, float]:
    """Return MAE, Top5, Top1 in rad of the normals of an unbiased estimate that knows where shadows are.

    The Cramer-Rao bound: with V_c the light of the LEDs that shine on a point, picture c is V_c . n, the information on
    a turn of n along the tangents e is F = sum_c (V_c . e)(V_c . e)^T / variance, and the angle's root mean square is
    sqrt(trace F^-1). The variance is that of noise and rounding. Where F is singular the angle is a right one.
    """
    lit = near_field.irradiance(seen, ring, cast_shadows=camera.cast_shadows) > 0
    light = np.einsum("ck,kp,kpi->pci", pictures, lit, ring.vectors) * gain * camera.full_scale_grey
    along = np.einsum("pci,pei->pce", light, _tangents(seen.normals))
    information = np.einsum("pce,pcf->pef", along, along) / (camera.noise_grey**2 + camera.quantised / 12)
    trace_, determinant = np.trace(information, axis1=1, axis2=2), np.linalg.det(information)
    # The trace of an inverse of two rows is trace over determinant.
    variance = np.divide(trace_, determinant, out=np.full_like(trace_, np.inf), where=determinant > 0)
    return error_figures(np.minimum(np.sqrt(variance), np.pi / 2))


def _tangents(normals: Array) -> Array:
    """Return two unit vectors across each normal, (P, 2, 3)."""
    first = np.cross(normals, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first)], axis=1)


@dataclass(frozen=True, eq=False)
class FineResult:
    """The fine stage: how well the normals are reconstructed at each height."""

    heights_mm: tuple[float, ...]
    errors_rad: dict[str, Array]
    """by medium, (methods + 1, heights, 2): MAE and Top1 averaged over the objects, NaN inside the window"""

    def errors_deg(self, medium: str, method: str) -> Array:
        """Return MAE and Top1 in degrees by height, (heights, 2), of one of `METHODS` or `EQUAL_LIGHT`."""
        return np.asarray(np.degrees(self.errors_rad[medium][[*METHODS, EQUAL_LIGHT].index(method)]))


def fine_study(setup: StudySetup, heights_mm: tuple[float, ...]) -> Study[FineResult]:
    """Return the fine study: one task an object and medium."""
    media = {"air": VACUUM, "window": window_of(setup.geometry)}

    def combine(errors: list[Any]) -> FineResult:
        shape = (len(media), len(setup.names), len(METHODS) + 1, len(heights_mm), 2)
        averaged = np.array(errors).reshape(shape).mean(axis=1)
        return FineResult(heights_mm, dict(zip(media, averaged, strict=True)))

    tasks = [
        Task(f"{name} ({label})", fine_errors, (name, setup, heights_mm, medium))
        for label, medium in media.items()
        for name in setup.names
    ]
    return Study(tasks, combine)
