"""The coarse study under each reading of the paper's text, and with one thing changed at a time."""

from dataclasses import replace
from typing import Any

import numpy as np

from gellight.lab.design.studies import StudySetup, coarse_study
from gellight.lab.simulator.sweep import Study, Task
from sim_reference.optimizer import coarse, sensitivity
from sim_reference.optimizer.exposing import LightGroups


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


def variant_errors(name: str, variant: sensitivity.Variant, setup: StudySetup) -> Any:
    """Return Top1 in rad by angle, 12 lights, of an object under a variant of the study of `setup`."""
    changed = replace(setup, geometry=variant.geometry, parameters=variant.parameters)
    return coarse.evaluate(changed.pressed(name, variant.sampling), variant.groups)[0, :, 2].tolist()


def sensitivity_study(setup: StudySetup) -> Study[list[tuple[sensitivity.Variant, float]]]:
    """Return the study of what the best angle of the averaged curve (rad) depends on: a task a variant and object."""
    variants = sensitivity.variants(setup.geometry, setup.with_noise(sensitivity.STUDIED), setup.sampling)

    def combine(errors: list[Any]) -> list[tuple[sensitivity.Variant, float]]:
        curves = np.array(errors).reshape(len(variants), len(setup.names), -1).mean(axis=1)
        angles = variants[0].groups.angles_rad
        return [(variant, angles[curve.argmin()]) for variant, curve in zip(variants, curves, strict=True)]

    tasks = [
        Task(f"{variant.quantity} {variant.setting}: {name}", variant_errors, (name, variant, setup))
        for variant in variants
        for name in setup.names
    ]
    return Study(tasks, combine)
