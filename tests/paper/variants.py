"""The coarse study under each reading of the paper's text, and with one thing changed at a time.

Twenty-nine degrees is the answer for surfaces with slopes of some sixty degrees, not a law of nature.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gellight_design.studies import StudySetup, coarse_study
from gellight_design.sweep import Study, Task
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import ObjectParameters
from sim_reference.optimizer import coarse
from sim_reference.optimizer.benchmark import Sampling
from sim_reference.optimizer.exposing import LightGroups

STUDIED = LightGroups(numbers=(coarse.CHOSEN_NUMBER,))
COARSE = Sampling(size_px=128)


def coarse_readings(setup: StudySetup, groups: LightGroups) -> Study[dict[str, coarse.CoarseResult]]:
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


@dataclass(frozen=True)
class Variant:
    """The study with one thing changed."""

    quantity: str
    setting: str
    groups: LightGroups = STUDIED
    sampling: Sampling = COARSE
    parameters: ObjectParameters = field(default_factory=ObjectParameters)
    geometry: SensorGeometry = field(default_factory=SensorGeometry)


def variants(geometry: SensorGeometry, groups: LightGroups = STUDIED, sampling: Sampling = COARSE) -> list[Variant]:
    """Return the study as it is, and with light, press, relief, coating and wavelength changed in turn."""
    base = Variant("as it is", "", groups, sampling, ObjectParameters(), geometry)
    return [base, *_of_the_light(base), *_of_the_press(base), *_of_the_surface(base)]


def _of_the_light(base: Variant) -> list[Variant]:
    noise = [(f"{grey:g} grey levels", replace(base.groups, noise_grey=grey)) for grey in (0.0, 0.5, 2.0, 4.0, 8.0)]
    return [
        *(replace(base, quantity="noise", setting=setting, groups=groups) for setting, groups in noise),
        replace(base, quantity="cast shadows", setting="none", groups=replace(base.groups, cast_shadows=False)),
        replace(base, quantity="full scale", setting="160", groups=replace(base.groups, full_scale_grey=160.0)),
    ]


def _of_the_press(base: Variant) -> list[Variant]:
    def pressed(quantity: str, setting: str, depth_mm: float, relief_mm: float = 1.0) -> Variant:
        return replace(
            base,
            quantity=quantity,
            setting=setting,
            parameters=ObjectParameters(relief_mm=relief_mm),
            sampling=replace(base.sampling, press_depth_mm=depth_mm),
        )

    relief = [(height, 0.9 * height) for height in (0.5, 1.5)]
    return [
        *(pressed("press", f"{depth:g} mm", depth) for depth in (0.5, 0.7, 1.0)),
        *(pressed("relief", f"{height:g} mm, press {depth:g} mm", depth, height) for height, depth in relief),
    ]


def _of_the_surface(base: Variant) -> list[Variant]:
    coating = [(width, replace(base.geometry, coating_smoothing_mm=width)) for width in (0.0, 0.2, 0.3)]
    wave = ObjectParameters(wavelength_mm=3.5)
    return [
        *(replace(base, quantity="coating", setting=f"smooths {w:g} mm", geometry=sensor) for w, sensor in coating),
        replace(base, quantity="wavelength", setting="3.5 mm", parameters=wave),
    ]


def variant_errors(name: str, variant: Variant, setup: StudySetup) -> Any:
    """Return Top1 in rad by angle, 12 lights, of an object under a variant of the study of `setup`."""
    changed = replace(setup, geometry=variant.geometry, parameters=variant.parameters)
    return coarse.evaluate(changed.pressed(name, variant.sampling), variant.groups)[0, :, 2].tolist()


def sensitivity_study(setup: StudySetup) -> Study[list[tuple[Variant, float]]]:
    """Return the study of what the best angle of the averaged curve (rad) depends on: a task a variant and object."""
    studied = variants(setup.geometry, setup.with_noise(STUDIED), setup.sampling)

    def combine(errors: list[Any]) -> list[tuple[Variant, float]]:
        curves = np.array(errors).reshape(len(studied), len(setup.names), -1).mean(axis=1)
        angles = studied[0].groups.angles_rad
        return [(variant, angles[curve.argmin()]) for variant, curve in zip(studied, curves, strict=True)]

    tasks = [
        Task(f"{variant.quantity} {variant.setting}: {name}", variant_errors, (name, variant, setup))
        for variant in studied
        for name in setup.names
    ]
    return Study(tasks, combine)
