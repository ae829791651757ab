"""Section 2.3.1, as one would write it down: one light group, one light, one picture at a time.

Slow and short. `coarse.evaluate` computes the same numbers with the work shared between groups; tests hold the two
together and the benchmark of the report compares their times.
"""

from math import pi, tan

import numpy as np
from numpy.typing import NDArray

from sim_reference.imaging import directional_image
from sim_reference.metrics import angular_error, error_figures
from sim_reference.optimizer.benchmark import PressedObject
from sim_reference.optimizer.exposing import LightGroups, expose, picture_key, ring_azimuths
from sim_reference.optimizer.shadows import horizon, reach
from sim_reference.photometric_stereo import ring_directions, solve_normals

Array = NDArray[np.float64]


def evaluate(pressed: PressedObject, groups: LightGroups, shadow_level: float | None = None) -> Array:
    """Return MAE, MAE_Top5, MAE_Top1 in rad of every light group: (numbers, angles, 3)."""
    return np.array(
        [
            [evaluate_group(pressed, groups, number, angle, shadow_level) for angle in groups.angles_rad]
            for number in groups.numbers
        ]
    )


def evaluate_group(
    pressed: PressedObject, groups: LightGroups, number: int, angle_rad: float, shadow_level: float | None = None
) -> tuple[float, float, float]:
    """Return MAE, MAE_Top5, MAE_Top1 in rad (equations 4, 5) of the normals found under one light group."""
    images = np.stack([light_picture(pressed, groups, number, light, angle_rad) for light in range(number)])
    found = solve_normals(images[:, None, :], ring_directions(number, angle_rad), shadow_level)[0]
    # Where no light arrives nothing is found; equation 4 with a normal of zero then says arccos 0, a right angle.
    return error_figures(np.where(images.any(axis=0), angular_error(found, pressed.normals), pi / 2))


def light_picture(pressed: PressedObject, groups: LightGroups, number: int, light: int, angle_rad: float) -> Array:
    """Return the picture (P,) of the region under light number `light` of a group: equation 2 and the camera."""
    brightness = directional_image(pressed.gradient_map, ring_directions(number, angle_rad)[light])
    azimuth = ring_azimuths(number)[light]
    if groups.cast_shadows:
        far = reach(pressed.depth_mm, angle_rad)
        raised = horizon(pressed.depth_mm.astype(np.float32), pressed.spacing_mm, 2 * pi * float(azimuth), far)
        brightness = brightness * (raised < 1 / tan(angle_rad))
    return expose(brightness[pressed.region], groups, picture_key(pressed.index, azimuth, angle_rad))
