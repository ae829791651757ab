"""Section 2.3.1: every light group of an object, light by light.

Two things are kept, for the groups share them: the horizon towards an azimuth serves every incident angle, and the
picture of one of the 54 distinct lights every group that the light belongs to.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from math import erfc, log, pi, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from sim_reference.metrics import angular_error, error_figures
from sim_reference.optimizer.benchmark import PressedObject
from sim_reference.optimizer.exposing import LightGroups, expose, picture_key, ring_azimuths
from sim_reference.optimizer.shadows import box_of, horizon, reach
from sim_reference.photometric_stereo import ring_directions, solve_normals

Array = NDArray[np.float64]
CHOSEN_NUMBER = 12
"""of lights: the choice of section 3.1.1"""


def evaluate(pressed: PressedObject, groups: LightGroups) -> Array:
    """Return MAE, MAE_Top5, MAE_Top1 in rad (equations 4, 5) of every light group: (numbers, angles, 3)."""
    raised = cache(partial(_raised, pressed, reach(pressed.depth_mm, max(groups.angles_rad))))

    def picture(angle: float, azimuth: Fraction, direction: Array) -> Array:
        """Equation 2 and the camera: (P,) grey levels under one light."""
        light = np.maximum(pressed.normals @ direction, 0)
        if groups.cast_shadows:
            light *= raised(azimuth) < 1 / tan(angle)
        return expose(light, groups, picture_key(pressed.index, azimuth, angle))

    errors = []
    for angle in groups.angles_rad:
        kept: dict[Fraction, Array] = {}
        for number in groups.numbers:
            azimuths, directions = ring_azimuths(number), ring_directions(number, angle)
            for azimuth, direction in zip(azimuths, directions, strict=True):
                if azimuth not in kept:
                    kept[azimuth] = picture(angle, azimuth, direction)
            errors.append(_figures(pressed, np.stack([kept[azimuth] for azimuth in azimuths]), directions))
    return np.swapaxes(np.reshape(errors, (len(groups.angles_rad), len(groups.numbers), 3)), 0, 1)


def _raised(pressed: PressedObject, far_mm: float, azimuth: Fraction) -> NDArray[np.floating]:
    """Return the tangent (P,) of the horizon's elevation towards an azimuth in turns."""
    box = box_of(pressed.region)
    turn = 2 * pi * float(azimuth)
    seen = horizon(pressed.depth_mm.astype(np.float32), pressed.spacing_mm, turn, far_mm, box)
    return seen[pressed.region[box[0] : box[1], box[2] : box[3]]]


def _figures(pressed: PressedObject, images: Array, directions: Array) -> tuple[float, float, float]:
    found = solve_normals(images[:, None, :], directions)[0]
    # Where no light arrives nothing is found; equation 4 with a normal of zero then says arccos 0, a right angle.
    return error_figures(np.where(images.any(axis=0), angular_error(found, pressed.normals), pi / 2))


def noise_law(groups: LightGroups, number: int, angle_rad: float) -> tuple[float, float, float]:
    """Return MAE, Top5, Top1 in rad of a plane without shadows, in closed form.

    The two slopes have independent errors of standard deviation s = sd / G sqrt(2 / n) / sin phi, with the variance
    1/12 of rounding added to the noise's, so the angle is Rayleigh distributed, and the mean of its largest share q is
    s (r + sqrt(pi / 2) erfc(r / sqrt 2) / q) with r = sqrt(-2 ln q): 1.2533 s, 2.808 s, 3.337 s.
    """
    variance = groups.noise_grey**2 + (1 / 12 if groups.quantised else 0.0)
    s = sqrt(variance) / groups.full_scale_grey * sqrt(2 / number) / sin(angle_rad)
    mean, top5, top1 = (_mean_of_largest_rayleigh(share) * s for share in (1.0, 0.05, 0.01))
    return mean, top5, top1


def _mean_of_largest_rayleigh(share: float) -> float:
    threshold = sqrt(-2 * log(share))
    return threshold + sqrt(pi / 2) * erfc(threshold / sqrt(2)) / share


@dataclass(frozen=True, eq=False)
class CoarseResult:
    """The errors of every object under every light group, and what follows from them."""

    names: tuple[str, ...]
    groups: LightGroups
    errors_rad: Array
    """(objects, numbers, angles, 3): MAE, MAE_Top5, MAE_Top1"""

    @property
    def mean_top1_rad(self) -> Array:
        """(numbers, angles) MAE_Top1, averaged over the objects."""
        return np.asarray(self.errors_rad[..., 2].mean(axis=0))

    def row(self, number: int) -> int:
        """Return the row of a number of lights; ValueError if it was not studied."""
        if number not in self.groups.numbers:
            raise ValueError(f"{number} lights were not studied: choose one of {self.groups.numbers}")
        return self.groups.numbers.index(number)

    def best_angle_rad(self, number: int = CHOSEN_NUMBER) -> float:
        """Return the angle at which the averaged Top1 curve of `number` lights is lowest."""
        return self.groups.angles_rad[int(self.mean_top1_rad[self.row(number)].argmin())]

    def best_angles_rad(self, number: int = CHOSEN_NUMBER) -> dict[str, float]:
        """Return the best angle of each object."""
        lowest = self.errors_rad[:, self.row(number), :, 2].argmin(axis=1)
        return {name: self.groups.angles_rad[at] for name, at in zip(self.names, lowest.tolist(), strict=True)}

    def mean_best_angle_rad(self, number: int = CHOSEN_NUMBER) -> float:
        """Return the mean of the objects' best angles: most likely the 32.2 degrees of section 3.1.1."""
        return float(np.mean(list(self.best_angles_rad(number).values())))

    def map_mean_by_number(self, reference: int = CHOSEN_NUMBER) -> dict[int, float]:
        """Return the mean of the heat map over all angles by number of lights, relative to `reference` lights."""
        means = self.mean_top1_rad.mean(axis=1)
        return dict(zip(self.groups.numbers, (means / means[self.row(reference)]).tolist(), strict=True))
