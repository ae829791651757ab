"""The studies of `sim_reference.optimizer`, each as independent tasks and a function that combines their results.

The functions that tasks call run in worker processes, so they return what JSON can hold.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight_design.simulating.choices import RESOLUTION_MM, GelKind
from gellight_design.simulating.gel_models import gel_model
from gellight_design.sweep import Study, Task
from sim_reference.deformation import GelModel
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.objects import BENCHMARK_NAMES, ObjectParameters
from sim_reference.optimizer import coarse, design, near_field
from sim_reference.optimizer.benchmark import PressedObject, Sampling, press_benchmark, region
from sim_reference.optimizer.exposing import LightGroups

Array = NDArray[np.float64]
DESIGN_SAMPLING = Sampling(region_diameter_mm=30.0, size_px=128)
DESIGN_THINNING = 2
"""every second pixel is evaluated, because a search repeats itself a hundred times"""


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
