"""The studies of `sim_reference.optimizer` as independent tasks, and their results put together again.

Functions named `..._of_object` and `design_of_number` run in worker processes; what they return JSON can hold.
"""

from dataclasses import dataclass, replace
from math import radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.design.sweep import Task, Way, run
from sim_reference.deformation import grid
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.objects import BENCHMARK_NAMES, ObjectParameters, object_height
from sim_reference.optimizer import coarse, design, exposures, fine, near_field, sensitivity
from sim_reference.optimizer.benchmark import Sampling, press_benchmark, region
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.optimizer.refraction import VACUUM, Medium, window_of

Array = NDArray[np.float64]
FINE_SAMPLING = Sampling(region_diameter_mm=30.0)
DESIGN_SAMPLING = Sampling(region_diameter_mm=30.0, size_px=128)
CAMERA = LightGroups(full_scale_grey=230.0)
METHODS = {
    "one exposure": (True, False),
    "each LED by itself": (False, False),
    "each LED by itself, shadows dropped": (False, True),
}
"""whether all LEDs shine at once, whether shadowed observations are dropped"""
THINNING = 6
"""one in so many pixels is enough where a study repeats itself a hundred times"""


@dataclass(frozen=True, kw_only=True)
class Subject:
    """What all studies share: the sensor and what is pressed into it."""

    geometry: SensorGeometry
    parameters: ObjectParameters
    sampling: Sampling = Sampling()  # noqa: RUF009 - frozen
    names: tuple[str, ...] = BENCHMARK_NAMES
    noise_grey: float = 1.0

    def seen_by(self, camera: LightGroups) -> LightGroups:
        """Return `camera` with the noise of this one."""
        return replace(camera, noise_grey=self.noise_grey)


def coarse_of_object(name: str, subject: Subject, groups: LightGroups) -> Any:
    """Return the errors in rad of every light group, (numbers, angles, 3) as lists."""
    pressed = press_benchmark(name, subject.sampling, subject.geometry, subject.parameters)
    return coarse.evaluate(pressed, groups).tolist()


def coarse_tasks(subject: Subject, groups: LightGroups) -> list[Task]:
    """Return the coarse study, one task an object."""
    return [Task(name, coarse_of_object, (name, subject, groups)) for name in subject.names]


def coarse_study(subject: Subject, groups: LightGroups, way: Way) -> coarse.CoarseResult | None:
    """Return the coarse study, or None while shards are missing."""
    errors = run(coarse_tasks(subject, groups), way)
    if any(found is None for found in errors):
        return None
    return coarse.CoarseResult(subject.names, groups, np.array(errors))


def scene_of(
    name: str, subject: Subject, sampling: Sampling, thinning: int = THINNING
) -> tuple[near_field.Scene, Array, Array]:
    """Press an object and return what is evaluated of it, with x, y (P,) in mm."""
    inside, _, _ = region(sampling, subject.geometry)
    points = np.zeros_like(inside)
    points.flat[np.flatnonzero(inside)[::thinning]] = True
    x, y = np.broadcast_arrays(*pixel_grid(sampling.on(subject.geometry)))
    pressed = press_benchmark(name, sampling, subject.geometry, subject.parameters)
    return near_field.scene(pressed, points), x[points], y[points]


def fine_of_object(name: str, subject: Subject, heights_mm: tuple[float, ...], medium: Medium) -> Any:
    """Return MAE and Top1 in rad by method and height: (methods, heights, 2) as lists.

    A height at which the LEDs would be inside the window has None.
    """
    sampling = replace(
        subject.sampling, region_diameter_mm=min(FINE_SAMPLING.region_diameter_mm, subject.sampling.region_diameter_mm)
    )
    seen, x, y = scene_of(name, subject, sampling)
    camera = subject.seen_by(CAMERA)
    rows = [_errors_at(fine.at_height(subject.geometry, height), seen, x, y, medium, camera) for height in heights_mm]
    return [[None if row is None else row[method] for row in rows] for method in range(len(METHODS))]


def _errors_at(
    geometry: SensorGeometry, seen: near_field.Scene, x: Array, y: Array, medium: Medium, camera: LightGroups
) -> Any:
    if geometry.camera_height_mm - geometry.mounting_height_mm <= medium.thickness_mm:
        return None
    ring = near_field.ring_light_vectors(geometry, x, y, medium)
    found = [
        near_field.normal_error(seen, ring, near_field.mixing(geometry, one_shot=at_once), camera, drop_shadows=drop)
        for at_once, drop in METHODS.values()
    ]
    return [[mae, top1] for mae, _, top1 in found]


@dataclass(frozen=True)
class FineResult:
    """The fine stage: how a plane is lit, and what is reconstructed, at each height."""

    heights_mm: tuple[float, ...]
    light: list[fine.Illumination]
    errors_rad: dict[str, Array]
    """by medium, (methods, heights, 2): MAE and Top1 averaged over the objects, NaN inside the window"""


def fine_study(subject: Subject, heights_mm: tuple[float, ...], way: Way) -> FineResult | None:
    """Return the fine study, or None while shards are missing."""
    media = {"air": VACUUM, "window": window_of(subject.geometry)}
    tasks = [
        Task(f"{name} ({label})", fine_of_object, (name, subject, heights_mm, medium))
        for label, medium in media.items()
        for name in subject.names
    ]
    found = run(tasks, way)
    if any(errors is None for errors in found):
        return None
    return _fine_result(subject, heights_mm, tuple(media), found)


def _fine_result(subject: Subject, heights: tuple[float, ...], media: tuple[str, ...], found: list[Any]) -> FineResult:
    count = len(subject.names)
    nothing = [float("nan"), float("nan")]
    filled = [[[cell or nothing for cell in method] for method in errors] for errors in found]
    averaged = {medium: np.array(filled[count * at : count * (at + 1)]).mean(axis=0) for at, medium in enumerate(media)}
    light = [fine.illumination(fine.at_height(subject.geometry, height), fine.View()) for height in heights]
    return FineResult(heights, light, averaged)


BEYOND_ANGLES = tuple(radians(angle) for angle in range(5, 86, 8))
CROSSTALK = np.array([[0.90, 0.08, 0.02], [0.06, 0.88, 0.06], [0.02, 0.08, 0.90]])


def beyond_of_object(name: str, subject: Subject) -> Any:
    """Return MAE, Top5, Top1 in rad of what goes beyond the paper, by the name of the method, as lists."""
    seen, _, _ = scene_of(name, subject, subject.sampling, 3)
    camera = subject.seen_by(LightGroups())
    number = len(subject.geometry.led_colours) // 3 * 3
    twelve = exposures.in_turn(number)
    window = window_of(subject.geometry)
    curves = {
        "least squares": [exposures.directional_error([seen], twelve, a, camera) for a in BEYOND_ANGLES],
        "shadows dropped": [
            exposures.directional_error([seen], twelve, a, camera, drop_shadows=True) for a in BEYOND_ANGLES
        ],
    }
    for label, restored in (("window, same lamps", False), ("window, exposure restored", True)):
        curves[label] = [
            exposures.directional_error([seen], twelve, a, camera, medium=window, exposure_restored=restored)
            for a in BEYOND_ANGLES
        ]
    for label, crosstalk in (("", None), (", crosstalk", CROSSTALK)):
        for scheme in (exposures.one_exposure(number, crosstalk), exposures.single_leds(number, crosstalk)):
            curves[scheme.name + label] = [exposures.directional_error([seen], scheme, radians(29), camera)]
    return curves


def beyond_study(subject: Subject, way: Way) -> dict[str, Array] | None:
    """Return (angles, 3) rad by the name of the method, averaged over the objects; None while shards are missing."""
    found = run([Task(name, beyond_of_object, (name, subject)) for name in subject.names], way)
    if any(curves is None for curves in found):
        return None
    complete: list[dict[str, Any]] = [curves for curves in found if curves is not None]
    return {label: np.mean([curves[label] for curves in complete], axis=0) for label in complete[0]}


def design_of_number(number: int, subject: Subject, wishes: design.Wishes) -> Any:
    """Return the best design with one number of LEDs, as the fields of `design.Candidate`."""
    (candidate,) = design.optimise(subject.geometry, _place(subject), replace(wishes, numbers=(number,)))
    return candidate.__dict__


def given_sensor(subject: Subject, wishes: design.Wishes) -> Any:
    """Return the sensor as it is, judged like a design, as the fields of `design.Candidate`."""
    return design.assessed(subject.geometry, _place(subject), wishes, design.STARTING_GREY).__dict__


def _place(subject: Subject) -> design.Place:
    sampling = replace(DESIGN_SAMPLING, press_depth_mm=subject.sampling.press_depth_mm)
    found = [scene_of(name, subject, sampling, 2) for name in subject.names]
    return design.Place([seen for seen, _, _ in found], found[0][1], found[0][2])


def given_study(subject: Subject, wishes: design.Wishes, way: Way) -> design.Candidate | None:
    """Return the sensor as it is, judged like a design; None while its shard is missing."""
    (found,) = run([Task("given", given_sensor, (subject, wishes))], way)
    return None if found is None else design.Candidate(**found)


def design_study(subject: Subject, wishes: design.Wishes, way: Way) -> list[design.Candidate] | None:
    """Return the best design for each number of LEDs; None while shards are missing."""
    tasks = [
        Task(f"{number} LEDs", design_of_number, (number, subject, replace(wishes, numbers=(number,))))
        for number in wishes.numbers
    ]
    found = run(tasks, way)
    return None if any(one is None for one in found) else [design.Candidate(**one) for one in found if one]


def variant_of_object(name: str, variant: sensitivity.Variant) -> Any:
    """Return Top1 in rad by angle, 12 lights, of an object under a variant of the study."""
    pressed = press_benchmark(name, variant.sampling, variant.geometry, variant.parameters)
    return coarse.evaluate(pressed, variant.groups)[0, :, 2].tolist()


def sensitivity_study(subject: Subject, way: Way) -> list[tuple[sensitivity.Variant, float, float]] | None:
    """Return each variant with the best angle of the averaged curve and the mean of the objects' best, in rad."""
    studied = sensitivity.variants(subject.geometry, subject.seen_by(sensitivity.STUDIED))
    tasks = [
        Task(f"{variant.quantity} {variant.setting}: {name}", variant_of_object, (name, variant))
        for variant in studied
        for name in subject.names
    ]
    found = run(tasks, way)
    if any(curve is None for curve in found):
        return None
    curves = np.array(found).reshape(len(studied), len(subject.names), -1)
    angles = np.array(studied[0].groups.angles_rad)
    best = angles[curves.mean(axis=1).argmin(axis=1)]
    means = angles[curves.argmin(axis=2)].mean(axis=1)
    return list(zip(studied, best.tolist(), means.tolist(), strict=True))


def benchmark_height(name: str, relief_mm: float, size: int) -> tuple[Array, float]:
    """Return an object's height map (size, size) in mm over 36 mm, highest point 0, and its spacing in mm."""
    spacing = 36.0 / size
    at = grid(size, spacing)
    return object_height(name, at[None, :], at[:, None], ObjectParameters(relief_mm=relief_mm)), spacing
