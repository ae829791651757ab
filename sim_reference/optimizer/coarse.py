"""Section 2.3.1, all light groups of an object at once.

What is shared, and why it is the same: the groups' 84 lights stand at 54 azimuths; a picture serves every group its
light belongs to; a horizon serves every incident angle; and for lights evenly around a ring the least squares of
`photometric_stereo.solve_normals` have a closed form, because the columns of L are orthogonal:

    g_x = 2 / (n sin phi) sum I cos a,   g_y = -2 / (n sin phi) sum I sin a,   g_z = 1 / (n cos phi) sum I
"""

from dataclasses import dataclass
from fractions import Fraction
from math import cos, erfc, log, pi, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from sim_reference.metrics import error_figures
from sim_reference.optimizer.benchmark import PressedObject
from sim_reference.optimizer.exposing import LightGroups, azimuths, expose, picture_key
from sim_reference.optimizer.shadows import box_of, horizon, reach

Array = NDArray[np.float64]
CHOSEN_NUMBER = 12
"""of lights: the choice of section 3.1.1"""


@dataclass(frozen=True, eq=False)
class Light:
    """One azimuth, and what does not depend on the incident angle."""

    azimuth: Fraction
    cosine: float
    sine: float
    sideways: Array
    """(P,) the normals' component towards the light"""
    horizon: NDArray[np.floating] | None
    """(P,) tangent of the horizon's elevation, None without cast shadows"""


def evaluate(pressed: PressedObject, groups: LightGroups) -> Array:
    """Return MAE, MAE_Top5, MAE_Top1 in rad of every light group: (numbers, angles, 3)."""
    truth = np.ascontiguousarray(pressed.normals.T)
    lights = ring_lights(pressed, groups, truth)
    result = np.empty((len(groups.numbers), len(groups.angles_rad), 3))
    for column, angle in enumerate(groups.angles_rad):
        for row, sums in enumerate(_sums(pressed, groups, lights, truth[2], angle)):
            number = groups.numbers[row]
            scale = np.array([2 / (number * sin(angle)), 2 / (number * sin(angle)), 1 / (number * cos(angle))])
            result[row, column] = error_figures(_angle_between(sums * scale[:, None], truth))
    return result


def ring_lights(pressed: PressedObject, groups: LightGroups, truth: Array) -> list[Light]:
    """Return every azimuth of `groups` with its horizon; `truth` is (3, P)."""
    far = reach(pressed.depth_mm, max(groups.angles_rad))
    depth, box = pressed.depth_mm.astype(np.float32), box_of(pressed.region)
    inside = pressed.region[box[0] : box[1], box[2] : box[3]]
    lights = []
    for azimuth in azimuths(groups.numbers):
        turn = 2 * pi * float(azimuth)
        shade = horizon(depth, pressed.spacing_mm, turn, far, box)[inside] if groups.cast_shadows else None
        lights.append(Light(azimuth, cos(turn), -sin(turn), truth[0] * cos(turn) - truth[1] * sin(turn), shade))
    return lights


def _sums(
    pressed: PressedObject, groups: LightGroups, lights: list[Light], upright: Array, angle: float
) -> list[Array]:
    """Return sum I cos a, -sum I sin a, sum I for each number of lights, (3, P) each."""
    sums = [np.zeros((3, len(upright))) for _ in groups.numbers]
    above = upright * cos(angle)
    for light in lights:
        image = _picture(pressed, groups, light, above, angle)
        across, down = image * light.cosine, image * light.sine
        for number, total in zip(groups.numbers, sums, strict=True):
            if number % light.azimuth.denominator == 0:
                total[0] += across
                total[1] += down
                total[2] += image
    return sums


def _picture(pressed: PressedObject, groups: LightGroups, light: Light, above: Array, angle: float) -> Array:
    """Equation 2 and the camera, as `plain.light_picture`; `above` is n_z cos phi."""
    brightness = light.sideways * sin(angle)
    brightness += above
    np.maximum(brightness, 0, out=brightness)
    if light.horizon is not None:
        brightness *= light.horizon < 1 / tan(angle)
    return expose(brightness, groups, picture_key(pressed.index, light.azimuth, angle))


def _angle_between(found: Array, truth: Array) -> Array:
    """Angle (P,) in rad between vectors (3, P), as `metrics.angular_error`; where nothing was found, a right angle."""
    cross = (found[1] * truth[2] - found[2] * truth[1]) ** 2
    cross += (found[2] * truth[0] - found[0] * truth[2]) ** 2
    cross += (found[0] * truth[1] - found[1] * truth[0]) ** 2
    along = (found * truth).sum(axis=0)
    return np.where(found.any(axis=0), np.arctan2(np.sqrt(cross), along), pi / 2)


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
