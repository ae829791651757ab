"""The studies of `sim_reference.optimizer`, each as independent tasks and a function that combines their results.

The functions that tasks call run in worker processes, so they return what JSON can hold.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.simulator.gel_models import RESOLUTION_MM, GelKind, gel_model
from gellight.lab.simulator.sweep import Study, Task
from sim_reference.deformation import GelModel
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.objects import BENCHMARK_NAMES, ObjectParameters
from sim_reference.optimizer import coarse, design, exposures, fine, near_field, sensitivity
from sim_reference.optimizer.benchmark import PressedObject, Sampling, press_benchmark, region
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.optimizer.refraction import VACUUM, Medium, window_of

Array = NDArray[np.float64]
FINE_DIAMETER_MM = 30.0
"""of the disc that the fine study evaluates at most"""
DESIGN_SAMPLING = Sampling(region_diameter_mm=30.0, size_px=128)
CAMERA = LightGroups(full_scale_grey=230.0)
METHODS = {
    "one exposure": (True, False),
    "each LED by itself": (False, False),
    "each LED by itself, shadows dropped": (False, True),
}
"""whether all LEDs shine at once, whether shadowed observations are dropped"""
EQUAL_LIGHT = "one exposure, least possible error"
"""of an unbiased estimate, lamps and exposure those of the given sensor at every height"""
FINE_THINNING, BEYOND_THINNING, DESIGN_THINNING = 6, 3, 2
"""one in so many pixels is evaluated, because a study repeats itself a hundred times"""
BEYOND_ANGLES = tuple(radians(angle) for angle in range(5, 86, 8))
PAPER_ANGLE_RAD = radians(29)
CROSSTALK = np.array([[0.90, 0.08, 0.02], [0.06, 0.88, 0.06], [0.02, 0.08, 0.90]])


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What all studies share: the sensor, the objects that are pressed into it, and the noise of its camera."""

    geometry: SensorGeometry
    parameters: ObjectParameters
    sampling: Sampling = Sampling()  # noqa: RUF009 - frozen
    names: tuple[str, ...] = BENCHMARK_NAMES
    noise_grey: float = 1.0
    gel: GelKind = "layer"
    resolution_mm: float = RESOLUTION_MM
    """of the finite elements"""

    @property
    def model(self) -> GelModel:
        """What computes the gel."""
        return gel_model(self.gel, self.resolution_mm)

    @property
    def led_count(self) -> int:
        """Number of LEDs of the sensor."""
        return len(self.geometry.led_colours)

    def with_noise(self, camera: LightGroups) -> LightGroups:
        """Return `camera` with the noise of this setup."""
        return replace(camera, noise_grey=self.noise_grey)

    def pressed(self, name: str, sampling: Sampling) -> PressedObject:
        """Press an object into the gel and sample it on the pixels."""
        return press_benchmark(name, sampling, self.geometry, self.parameters, self.model)

    def press(self, name: str, sampling: Sampling, thinning: int) -> design.Place:
        """Press an object and return where it is evaluated: one in `thinning` pixels of the sampled disc."""
        inside, _, _ = region(sampling, self.geometry)
        points = np.zeros_like(inside)
        points.flat[np.flatnonzero(inside)[::thinning]] = True
        x, y = np.broadcast_arrays(*pixel_grid(sampling.on(self.geometry)))
        pressed = self.pressed(name, sampling)
        return design.Place([near_field.scene(pressed, points)], x[points], y[points])


def setup_of(
    geometry: SensorGeometry,
    press_mm: float,
    relief_mm: float,
    size_px: int,
    noise_grey: float = 1.0,
) -> Setup:
    """Return the setup of a study.

    `size_px` is the side of the square picture of each pressed object. Raises InputError for a press that is not
    positive or deeper than 60 % of the gel, and for a relief that is not positive and less than the gel.
    """
    if not 0 < press_mm <= geometry.deepest_press_mm:
        raise InputError(
            f"--press {press_mm:g} mm: it must be positive and at most {geometry.deepest_press_mm:g} mm, 60 % of the "
            f"gel's {geometry.gel_thickness_mm:g} mm"
        )
    if not 0 < relief_mm < geometry.gel_thickness_mm:
        raise InputError(
            f"--relief {relief_mm:g} mm: it must be positive and less than the gel's {geometry.gel_thickness_mm:g} mm"
        )
    return Setup(
        geometry=geometry,
        parameters=ObjectParameters(relief_mm=relief_mm),
        sampling=Sampling(size_px=size_px, press_depth_mm=press_mm),
        noise_grey=noise_grey,
    )


def coarse_errors(name: str, setup: Setup, groups: LightGroups) -> Any:
    """Return MAE, Top5 and Top1 in rad of an object in every light group: (numbers, angles, 3) as lists."""
    return coarse.evaluate(setup.pressed(name, setup.sampling), groups).tolist()


def coarse_study(setup: Setup, groups: LightGroups) -> Study[coarse.CoarseResult]:
    """Return the coarse study: one task an object."""
    return Study(
        [Task(name, coarse_errors, (name, setup, groups)) for name in setup.names],
        lambda errors: coarse.CoarseResult(setup.names, groups, np.array(errors)),
    )


def coarse_readings(setup: Setup, groups: LightGroups) -> Study[dict[str, coarse.CoarseResult]]:
    """Return the coarse study under the readings of the paper's text; the first is `setup` as it is."""
    lights = {
        f"noise of {groups.noise_grey:g} grey level{'' if groups.noise_grey == 1 else 's'}": groups,
        "no noise": replace(groups, noise_grey=0.0),
    }
    forms = {"": setup.parameters, "; CCONVEX as prisms": replace(setup.parameters, curves_as_prisms=True)}
    readings = {
        light + form: coarse_study(replace(setup, parameters=parameters), lights[light])
        for light in lights
        for form, parameters in forms.items()
    }

    def combine(errors: list[Any]) -> dict[str, coarse.CoarseResult]:
        by_reading = zip(readings.items(), _chunks(errors, len(setup.names)), strict=True)
        return {name: study.combine(own) for (name, study), own in by_reading}

    return Study([task for study in readings.values() for task in study.tasks], combine)


def _chunks(values: list[Any], size: int) -> list[list[Any]]:
    return [values[at : at + size] for at in range(0, len(values), size)]


def fine_errors(name: str, setup: Setup, heights_mm: tuple[float, ...], medium: Medium) -> Any:
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
    errors.append(near_field.least_error(place.scenes[0], ring, at_once, camera, gain=gain_mm2 / above_mm**2))
    return np.array([[mae, top1] for mae, _, top1 in errors])


@dataclass(frozen=True, eq=False)
class FineResult:
    """The fine stage: how a plane is lit, and how well the normals are reconstructed, at each height."""

    heights_mm: tuple[float, ...]
    light: list[fine.Illumination]
    errors_rad: dict[str, Array]
    """by medium, (methods + 1, heights, 2): MAE and Top1 averaged over the objects, NaN inside the window"""

    @property
    def half_saturation_mm(self) -> float:
        """Height at which SAT reaches 50 %, NaN if it does at none of the heights."""
        return fine.height_of_saturation(np.array(self.heights_mm), np.array([one.saturation for one in self.light]))

    def errors_deg(self, medium: str, method: str) -> Array:
        """Return MAE and Top1 in degrees by height, (heights, 2), of one of `METHODS` or `EQUAL_LIGHT`."""
        return np.asarray(np.degrees(self.errors_rad[medium][[*METHODS, EQUAL_LIGHT].index(method)]))


def fine_study(setup: Setup, heights_mm: tuple[float, ...]) -> Study[FineResult]:
    """Return the fine study: one task an object and medium."""
    media = {"air": VACUUM, "window": window_of(setup.geometry)}

    def combine(errors: list[Any]) -> FineResult:
        shape = (len(media), len(setup.names), len(METHODS) + 1, len(heights_mm), 2)
        averaged = np.array(errors).reshape(shape).mean(axis=1)
        light = [fine.illumination(fine.at_height(setup.geometry, height), fine.View()) for height in heights_mm]
        return FineResult(heights_mm, light, dict(zip(media, averaged, strict=True)))

    tasks = [
        Task(f"{name} ({label})", fine_errors, (name, setup, heights_mm, medium))
        for label, medium in media.items()
        for name in setup.names
    ]
    return Study(tasks, combine)


@dataclass(frozen=True, eq=False)
class BeyondResult:
    """MAE, Top5 and Top1 in rad of the methods beyond the paper, averaged over the objects."""

    curves: Mapping[str, Array]
    """by method, (angles, 3): an error for each of `BEYOND_ANGLES`"""
    schemes: Mapping[str, Array]
    """by exposure scheme, (3,), at the paper's incident angle"""

    @property
    def few_exposures(self) -> str:
        """Name of the scheme that lights three LEDs in each exposure: "4 exposures" of twelve LEDs."""
        return list(self.schemes)[1]


def beyond_errors(name: str, setup: Setup) -> Any:
    """Return the lists of errors of `BeyondResult` for one object: curves and schemes, by name."""
    scenes = setup.press(name, setup.sampling, BEYOND_THINNING).scenes
    camera = setup.with_noise(LightGroups())
    number = setup.led_count // 3 * 3
    window = window_of(setup.geometry)
    methods: dict[str, dict[str, Any]] = {
        "least squares": {},
        "shadows dropped": {"drop_shadows": True},
        "window, same lamps": {"medium": window},
        "window, exposure restored": {"medium": window, "exposure_restored": True},
    }
    in_turn = exposures.in_turn(number)
    curves = {
        method: [exposures.directional_error(scenes, in_turn, angle, camera, **options) for angle in BEYOND_ANGLES]
        for method, options in methods.items()
    }
    schemes = {
        scheme.name + label: exposures.directional_error(scenes, scheme, PAPER_ANGLE_RAD, camera)
        for label, crosstalk in (("", None), (", crosstalk", CROSSTALK))
        for scheme in (exposures.one_exposure(number, crosstalk), exposures.single_leds(number, crosstalk))
    }
    return {"curves": curves, "schemes": schemes}


def beyond_study(setup: Setup) -> Study[BeyondResult]:
    """Return the study of what goes beyond the paper: one task an object."""

    def averaged(errors: list[Any], part: str) -> dict[str, Array]:
        return {name: np.mean([one[part][name] for one in errors], axis=0) for name in errors[0][part]}

    return Study(
        [Task(name, beyond_errors, (name, setup)) for name in setup.names],
        lambda errors: BeyondResult(averaged(errors, "curves"), averaged(errors, "schemes")),
    )


def best_candidate(setup: Setup, requirements: design.Requirements) -> Any:
    """Return the best design for the one number of LEDs that is required, as fields of `design.Candidate`."""
    (candidate,) = design.optimise(setup.geometry, _place(setup), requirements)
    return asdict(candidate)


def given_candidate(setup: Setup, requirements: design.Requirements) -> Any:
    """Return the sensor as it is, judged like a design, as fields of `design.Candidate`."""
    return asdict(design.assessed(setup.geometry, _place(setup), requirements, design.STARTING_GREY))


def _place(setup: Setup) -> design.Place:
    sampling = replace(DESIGN_SAMPLING, press_depth_mm=setup.sampling.press_depth_mm)
    pressed = [setup.press(name, sampling, DESIGN_THINNING) for name in setup.names]
    return replace(pressed[0], scenes=[one.scenes[0] for one in pressed])


def given_study(setup: Setup, requirements: design.Requirements) -> Study[design.Candidate]:
    """Return the study of the sensor as it is, judged like a design: one task."""
    return Study([Task("given", given_candidate, (setup, requirements))], lambda found: design.Candidate(**found[0]))


def design_study(setup: Setup, requirements: design.Requirements) -> Study[list[design.Candidate]]:
    """Return the study of the best designs: one task a number of LEDs."""
    return Study(
        [Task(f"{n} LEDs", best_candidate, (setup, replace(requirements, numbers=(n,)))) for n in requirements.numbers],
        lambda found: [design.Candidate(**one) for one in found],
    )


@dataclass(frozen=True)
class VariantResult:
    """The coarse study with one thing changed."""

    variant: sensitivity.Variant
    best_angle_rad: float
    """of the curve averaged over the objects"""
    mean_best_angle_rad: float
    """mean of the objects' best angles"""


def variant_errors(name: str, variant: sensitivity.Variant, setup: Setup) -> Any:
    """Return Top1 in rad by angle, 12 lights, of an object under a variant of the study of `setup`."""
    changed = replace(setup, geometry=variant.geometry, parameters=variant.parameters)
    return coarse.evaluate(changed.pressed(name, variant.sampling), variant.groups)[0, :, 2].tolist()


def sensitivity_study(setup: Setup) -> Study[list[VariantResult]]:
    """Return the study of what the best angle depends on: one task a variant and object."""
    variants = sensitivity.variants(setup.geometry, setup.with_noise(sensitivity.STUDIED))

    def combine(errors: list[Any]) -> list[VariantResult]:
        curves = np.array(errors).reshape(len(variants), len(setup.names), -1)
        angles = np.array(variants[0].groups.angles_rad)
        best = angles[curves.mean(axis=1).argmin(axis=1)]
        means = angles[curves.argmin(axis=2)].mean(axis=1)
        return [VariantResult(*one) for one in zip(variants, best.tolist(), means.tolist(), strict=True)]

    tasks = [
        Task(f"{variant.quantity} {variant.setting}: {name}", variant_errors, (name, variant, setup))
        for variant in variants
        for name in setup.names
    ]
    return Study(tasks, combine)
