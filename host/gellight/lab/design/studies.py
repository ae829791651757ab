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
from gellight.lab.simulator.choices import RESOLUTION_MM, GelKind
from gellight.lab.simulator.gel_models import gel_model
from gellight.lab.simulator.sweep import Study, Task
from sim_reference.deformation import GelModel
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.objects import BENCHMARK_NAMES, ObjectParameters
from sim_reference.optimizer import coarse, design, exposures, near_field
from sim_reference.optimizer.benchmark import PressedObject, Sampling, press_benchmark, region
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.refraction import window_of

Array = NDArray[np.float64]
DESIGN_SAMPLING = Sampling(region_diameter_mm=30.0, size_px=128)
BEYOND_THINNING, DESIGN_THINNING = 3, 2
"""every third and every second pixel is evaluated, because a study repeats itself a hundred times"""
BEYOND_ANGLES = tuple(radians(angle) for angle in range(5, 86, 8))
PAPER_ANGLE_RAD = radians(29)
CROSSTALK = np.array([[0.90, 0.08, 0.02], [0.06, 0.88, 0.06], [0.02, 0.08, 0.90]])


@dataclass(frozen=True, kw_only=True)
class StudySetup:
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


def study_setup(
    geometry: SensorGeometry, press_mm: float, relief_mm: float, size_px: int, noise_grey: float = 1.0
) -> StudySetup:
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
    return StudySetup(
        geometry=geometry,
        parameters=ObjectParameters(relief_mm=relief_mm),
        sampling=Sampling(size_px=size_px, press_depth_mm=press_mm),
        noise_grey=noise_grey,
    )


def coarse_errors(name: str, setup: StudySetup, groups: LightGroups) -> Any:
    """Return MAE, Top5 and Top1 in rad of an object in every light group: (numbers, angles, 3) as lists."""
    return coarse.evaluate(setup.pressed(name, setup.sampling), groups).tolist()


def coarse_study(setup: StudySetup, groups: LightGroups) -> Study[coarse.CoarseResult]:
    """Return the coarse study: one task an object."""
    return Study(
        [Task(name, coarse_errors, (name, setup, groups)) for name in setup.names],
        lambda errors: coarse.CoarseResult(setup.names, groups, np.array(errors)),
    )


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


def beyond_errors(name: str, setup: StudySetup) -> Any:
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


def beyond_study(setup: StudySetup) -> Study[BeyondResult]:
    """Return the study of what goes beyond the paper: one task an object."""

    def averaged(errors: list[Any], part: str) -> dict[str, Array]:
        return {name: np.mean([one[part][name] for one in errors], axis=0) for name in errors[0][part]}

    return Study(
        [Task(name, beyond_errors, (name, setup)) for name in setup.names],
        lambda errors: BeyondResult(averaged(errors, "curves"), averaged(errors, "schemes")),
    )


def best_candidate(setup: StudySetup, requirements: design.Requirements) -> Any:
    """Return the best design for the one number of LEDs that is required, as fields of `design.Candidate`."""
    (candidate,) = design.optimise(setup.geometry, _place(setup), requirements)
    return asdict(candidate)


def given_candidate(setup: StudySetup, requirements: design.Requirements) -> Any:
    """Return the sensor as it is, judged like a design, as fields of `design.Candidate`."""
    return asdict(design.assessed(setup.geometry, _place(setup), requirements, design.STARTING_GREY))


def _place(setup: StudySetup) -> design.Place:
    sampling = replace(DESIGN_SAMPLING, press_depth_mm=setup.sampling.press_depth_mm)
    pressed = [setup.press(name, sampling, DESIGN_THINNING) for name in setup.names]
    return replace(pressed[0], scenes=[one.scenes[0] for one in pressed])


def given_study(setup: StudySetup, requirements: design.Requirements) -> Study[design.Candidate]:
    """Return the study of the sensor as it is, judged like a design: one task."""
    return Study([Task("given", given_candidate, (setup, requirements))], lambda found: design.Candidate(**found[0]))


def design_study(setup: StudySetup, requirements: design.Requirements) -> Study[list[design.Candidate]]:
    """Return the study of the best designs: one task a number of LEDs."""
    return Study(
        [Task(f"{n} LEDs", best_candidate, (setup, replace(requirements, numbers=(n,)))) for n in requirements.numbers],
        lambda found: [design.Candidate(**one) for one in found],
    )
