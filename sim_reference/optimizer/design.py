"""A design for a purpose: incident angle, mounting height, number of LEDs and exposure, by what is reconstructed.

The paper chooses the angle under parallel light and the height by colour. Here both, with the number of LEDs and the
exposure, minimise the error of the method that will be used, under the noise of the camera at hand and on surfaces as
steep as those to be felt. Every evaluation draws the same noise, so the criterion is a function and a simplex search
finds its minimum.
"""

from dataclasses import dataclass, replace
from math import degrees, pi, radians, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer.exposing import WHITE, LightGroups
from sim_reference.optimizer.near_field import Ring, Scene, mixing, normal_error, restoring_gain, ring_light_vectors
from sim_reference.refraction import window_of

Array = NDArray[np.float64]
FIRST_GREY = 200.0
"""where the search for the brightest grey level begins"""
FIGURES = ("mae", "top5", "top1")
ENOUGH = 1.10
"""the fewest LEDs whose error is within a tenth of the best are chosen"""
MOST_EVALUATIONS = 600
"""of the error by one search; about a hundred are needed"""
STARTING_GREY = 230.0
"""of the brightest pixel: how the sensor that we start from is exposed"""


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Requirements: how the sensor is used, and within which limits the search may change it."""

    numbers: tuple[int, ...] = (6, 9, 12, 15)
    """of LEDs, multiples of three"""
    one_shot: bool = False
    """one exposure in three colours; otherwise every LED in a picture of its own"""
    drop_shadows: bool = True
    figure: str = "top1"
    noise_grey: float = 1.0
    angle_bounds_rad: tuple[float, float] = (radians(5), radians(80))
    clearance_mm: float = 2.0
    """between the LEDs and the window"""
    grey_bounds: tuple[float, float] = (60.0, 230.0)
    """of the brightest pixel of the gel at rest; nearer to white, clipping would hide half of the noise"""
    exposure_limit: float = float("inf")
    """longest exposure, as a multiple of the one the sensor we start from needs for 230 grey levels"""

    def __post_init__(self) -> None:
        """Refuse requirements that cannot be met."""
        if not self.numbers or any(number < 3 or number % 3 for number in self.numbers):
            raise ValueError(f"numbers of LEDs {self.numbers}: give multiples of 3, at least 3")
        if self.figure not in FIGURES:
            raise ValueError(f"figure {self.figure!r}: choose one of {', '.join(FIGURES)}")
        if self.one_shot and self.drop_shadows:
            raise ValueError("one exposure has three observations a pixel: none of them can be dropped")


@dataclass(frozen=True)
class Candidate:
    """The best design with one number of LEDs."""

    number: int
    incident_angle_rad: float
    mounting_height_mm: float
    brightest_grey: float
    mae_rad: float
    top5_rad: float
    top1_rad: float
    noise_mae_rad: float
    """what the closed form says noise alone does to a plane: the rest is shadow and clipping"""
    evaluations: int
    converged: bool = True
    """whether the search ended by itself, not at `MOST_EVALUATIONS`"""

    def figure_rad(self, name: str) -> float:
        """Return the error by its name in `FIGURES`."""
        return float(getattr(self, f"{name}_rad"))


@dataclass(frozen=True, eq=False)
class Place:
    """Where the error is measured: scenes that share the points x, y (P,) in mm."""

    scenes: list[Scene]
    x: Array
    y: Array


def colours_of(number: int, geometry: SensorGeometry) -> str:
    """Return the colours of a ring of `number` LEDs: the given ones if they are as many, else a third in each."""
    if number == len(geometry.led_colours):
        return geometry.led_colours
    return "R" * (number // 3) + "G" * (number // 3) + "B" * (number // 3)


def optimise(geometry: SensorGeometry, place: Place, requirements: Requirements) -> list[Candidate]:
    """Return the best candidate for each number of LEDs, in the order of `requirements.numbers`.

    Raises ValueError if there is no room for the LEDs, or if they leave the gel dark.
    """
    return [_best_of(number, geometry, place, requirements) for number in requirements.numbers]


def chosen(candidates: list[Candidate], figure: str) -> Candidate:
    """Return the candidate with the fewest LEDs that is within `ENOUGH` of the best."""
    best = min(candidate.figure_rad(figure) for candidate in candidates)
    good = [candidate for candidate in candidates if candidate.figure_rad(figure) <= ENOUGH * best]
    return min(good, key=lambda candidate: candidate.number)


def errors(
    geometry: SensorGeometry,
    place: Place,
    requirements: Requirements,
    brightest_grey: float,
    longest: float = float("inf"),
) -> tuple[float, float, float]:
    """Return MAE, Top5, Top1 in rad, averaged over the scenes, of the sensor `geometry`.

    `longest` is the longest exposure in full scales per light: beyond it the picture stays darker than wanted.
    """
    ring = ring_light_vectors(geometry, place.x, place.y, window_of(geometry))
    pictures = mixing(geometry, one_shot=requirements.one_shot)
    camera = LightGroups(noise_grey=requirements.noise_grey)
    gain = _gain(ring, pictures, brightest_grey, longest)
    found = [
        normal_error(seen, ring, pictures, camera, drop_shadows=requirements.drop_shadows, gain=gain)
        for seen in place.scenes
    ]
    mae, top5, top1 = np.mean(found, axis=0).tolist()
    return mae, top5, top1


@dataclass(frozen=True, eq=False)
class _Search:
    """What the simplex varies: incident angle, height and brightest grey level, as shares (3,) of their bounds."""

    number: int
    geometry: SensorGeometry
    place: Place
    requirements: Requirements
    low: Array
    high: Array
    longest: float
    """exposure in full scales per absolute light"""

    def at(self, share: Array) -> tuple[SensorGeometry, float, float]:
        """Return the sensor, its brightest grey level, and its longest exposure in full scales per light."""
        angle, height, grey = (self.low + np.clip(share, 0, 1) * (self.high - self.low)).tolist()
        sensor = replace(
            self.geometry,
            led_colours=colours_of(self.number, self.geometry),
            incident_angle_rad=angle,
            mounting_height_mm=height,
        )
        return sensor, grey, self.longest / (sensor.camera_height_mm - height) ** 2

    def error(self, share: Array) -> float:
        """Return the error that the search minimises."""
        sensor, grey, longest = self.at(share)
        return errors(sensor, self.place, self.requirements, grey, longest)[FIGURES.index(self.requirements.figure)]

    def simplex(self) -> Array:
        """Return the sensor we start from and three neighbours of it, (4, 3), inside the bounds."""
        start = np.array([self.geometry.incident_angle_rad, self.geometry.mounting_height_mm, FIRST_GREY])
        begin = np.clip((start - self.low) / (self.high - self.low), 0.05, 0.95)
        steps = 0.15 * np.diag(np.where(begin > 0.5, -1.0, 1.0))
        return np.asarray(begin + np.concatenate([np.zeros((1, 3)), steps]))


def _best_of(number: int, geometry: SensorGeometry, place: Place, requirements: Requirements) -> Candidate:
    low, high = _bounds(geometry, requirements)
    search = _Search(number, geometry, place, requirements, low, high, _longest_exposure(geometry, place, requirements))
    simplex = search.simplex()
    options = {"initial_simplex": simplex, "maxfev": MOST_EVALUATIONS, "xatol": 0.004, "fatol": radians(0.001)}
    found = minimize(search.error, simplex[0], method="Nelder-Mead", bounds=[(0.0, 1.0)] * 3, options=options)
    sensor, grey, longest = search.at(found.x)
    best = assessed(sensor, place, requirements, grey, longest)
    return replace(best, evaluations=int(found.nfev), converged=bool(found.success))


def _bounds(geometry: SensorGeometry, requirements: Requirements) -> tuple[Array, Array]:
    window_mm = window_of(geometry).thickness_mm
    highest = geometry.camera_height_mm - window_mm - requirements.clearance_mm
    if highest <= 0:
        raise ValueError(
            f"the camera is {geometry.camera_height_mm:g} mm above the gel surface, {window_mm:g} mm of them gel and "
            "acrylic: there is no room for the LEDs between them, raise camera_height_mm"
        )
    low = np.array([requirements.angle_bounds_rad[0], 0.0, requirements.grey_bounds[0]])
    high = np.array([requirements.angle_bounds_rad[1], highest, requirements.grey_bounds[1]])
    return low, high


def _longest_exposure(geometry: SensorGeometry, place: Place, requirements: Requirements) -> float:
    """Return the limit in full scales per absolute light, that is irradiance over height squared."""
    if requirements.exposure_limit == float("inf"):
        return float("inf")
    ring = ring_light_vectors(geometry, place.x, place.y, window_of(geometry))
    gain = restoring_gain(ring, mixing(geometry, one_shot=requirements.one_shot)) * STARTING_GREY / WHITE
    return requirements.exposure_limit * gain * (geometry.camera_height_mm - geometry.mounting_height_mm) ** 2


def assessed(
    geometry: SensorGeometry,
    place: Place,
    requirements: Requirements,
    brightest_grey: float,
    longest: float = float("inf"),
) -> Candidate:
    """Return the sensor `geometry` as a candidate, without a search; arguments as of `errors`."""
    ring = ring_light_vectors(geometry, place.x, place.y, window_of(geometry))
    pictures = mixing(geometry, one_shot=requirements.one_shot)
    gain = _gain(ring, pictures, brightest_grey, longest)
    mae, top5, top1 = errors(geometry, place, requirements, brightest_grey, longest)
    return Candidate(
        len(geometry.led_colours),
        geometry.incident_angle_rad,
        geometry.mounting_height_mm,
        gain / restoring_gain(ring, pictures) * WHITE,
        mae,
        top5,
        top1,
        noise_law(ring, pictures, requirements.noise_grey, gain * WHITE),
        1,
    )


def _gain(ring: Ring, pictures: Array, brightest_grey: float, longest: float) -> float:
    """Exposure in full scales per light that is wanted, or the longest there is."""
    return min(restoring_gain(ring, pictures) * brightest_grey / WHITE, longest)


def noise_law(ring: Ring, pictures: Array, noise_grey: float, grey_per_light: float) -> float:
    """Return the MAE in rad that noise alone gives on a plane, in closed form.

    The least squares of section 2.3.1 have the covariance sd^2 (L^T L)^-1, so the angle of an upright normal has the
    mean square sd^2 (C_xx + C_yy) and, with errors alike in x and y, the mean sqrt(pi / 4) times its root.
    """
    vectors = np.einsum("ck,kpi->pci", pictures, ring.vectors) * grey_per_light
    covariance = np.linalg.inv(np.swapaxes(vectors, 1, 2) @ vectors)
    spread = np.sqrt((noise_grey**2 + 1 / 12) * (covariance[:, 0, 0] + covariance[:, 1, 1]))
    return sqrt(pi / 4) * float(spread.mean())


def describe(candidate: Candidate) -> str:
    """Return one line on a candidate, angles in degrees."""
    return (
        f"{candidate.number} LEDs, {degrees(candidate.incident_angle_rad):.1f} degrees, "
        f"{candidate.mounting_height_mm:.1f} mm: Top1 {degrees(candidate.top1_rad):.2f}, MAE "
        f"{degrees(candidate.mae_rad):.3f} degrees"
        f"{'' if candidate.converged else f' (NOT the best: the search broke off after {candidate.evaluations} tries)'}"
    )
