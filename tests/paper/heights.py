"""How well normals are found at each mounting height, as in the paper's fine stage."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gellight_design.studies import StudySetup
from sim_reference.metrics import error_figures
from sim_reference.optimizer import fine, near_field
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.refraction import VACUUM, Medium, window_of

Array = NDArray[np.float64]
CAMERA = LightGroups(full_scale_grey=230.0)
LEAST_SQUARES, ANY_ESTIMATE = 0, 1
"""one exposure; the second is the least possible error, under as much light at every height"""
THINNING = 6
"""one in that many pixels is evaluated"""


def mean_errors_deg(setup: StudySetup, heights_mm: tuple[float, ...]) -> dict[str, Array]:
    """Return the mean error over all objects in `air` and behind the `window`: (estimates, heights).

    It is NaN at a height where the LEDs would be inside the window.
    """
    media = {"air": VACUUM, "window": window_of(setup.geometry)}
    return {
        label: np.degrees([_errors(name, setup, heights_mm, medium) for name in setup.names]).mean(axis=0)
        for label, medium in media.items()
    }


def _errors(name: str, setup: StudySetup, heights_mm: tuple[float, ...], medium: Medium) -> Array:
    diameter = min(30.0, setup.sampling.region_diameter_mm)
    place = setup.press(name, replace(setup.sampling, region_diameter_mm=diameter), THINNING)
    camera, given = setup.with_noise(CAMERA), near_field.ring_light_vectors(setup.geometry, place.x, place.y, medium)
    h_mm = setup.geometry.camera_height_mm - setup.geometry.mounting_height_mm
    # The unit of light is that of an LED straight above, which falls with the square of its height.
    gain_mm2 = near_field.restoring_gain(given, near_field.mixing(setup.geometry, one_shot=True)) * h_mm**2
    errors = np.full((2, len(heights_mm)), np.nan)
    for at, height in enumerate(heights_mm):
        geometry = fine.at_height(setup.geometry, height)
        above_mm = geometry.camera_height_mm - height
        if above_mm > medium.thickness_mm:
            ring = near_field.ring_light_vectors(geometry, place.x, place.y, medium)
            seen, mixed = place.scenes[0], near_field.mixing(geometry, one_shot=True)
            errors[LEAST_SQUARES, at] = near_field.normal_error(seen, ring, mixed, camera, drop_shadows=False)[0]
            errors[ANY_ESTIMATE, at] = least_error(seen, ring, mixed, camera, gain=gain_mm2 / above_mm**2)[0]
    return errors


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
