"""The paper's twenty statements on light, each a criterion on what is measured here, by reading of its text."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import degrees, radians

import numpy as np
from numpy.typing import NDArray

from gellight_design.studies import StudySetup, coarse_study
from gellight_design.sweep import run_study
from sim_reference.geometry import ACRYLIC_MM, SensorGeometry
from sim_reference.metrics import maximum_elevation
from sim_reference.optimizer import fine
from sim_reference.optimizer.coarse import CHOSEN_NUMBER, CoarseResult
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.refraction import Medium, refracted
from tests.paper.heights import ANY_ESTIMATE, LEAST_SQUARES, Array, mean_errors_deg

Judged = dict[str, list[str]]
"""by statement: the readings under which it holds; those of the defaults are first of their stage"""
ENCODED = replace(fine.IDEAL_CAMERA, gamma=2.2)
PAPER_ANGLE_RAD = radians(29)
PAPER_BEAM_RAD = radians(160)
DEFAULTS = (
    "noise of 1 grey level", "disc of 35 mm, linear picture; beam of 120°",
    "one exposure, least squares, in air", "no refraction",
)  # fmt: skip


def judgements(setup: StudySetup) -> Judged:
    return coarse_judgements(coarse_readings(setup)) | fine_judgements(setup) | ball_judgements()


def _judged(statements: Mapping[str, Callable[..., bool]], readings: Mapping[str, tuple[object, ...]]) -> Judged:
    return {
        claim: [reading for reading, measured in readings.items() if holds(*measured)]
        for claim, holds in statements.items()
    }


# ---- section 3.1.1, the coarse stage ----


def coarse_readings(setup: StudySetup) -> dict[str, CoarseResult]:
    """Return the coarse study under the readings of the paper's text; the first is `setup` as it is."""
    lights = {"noise of 1 grey level": LightGroups(), "no noise": LightGroups(noise_grey=0.0)}
    forms = {"": setup.parameters, "; CCONVEX as prisms": replace(setup.parameters, curves_as_prisms=True)}
    return {
        light + form: run_study(coarse_study(replace(setup, parameters=parameters), groups))
        for light, groups in lights.items()
        for form, parameters in forms.items()
    }


def coarse_judgements(by_reading: Mapping[str, CoarseResult]) -> Judged:
    """Return the statements of section 3.1.1 under each reading; two of them have a reading more."""
    judged = _judged(COARSE, {reading: (result,) for reading, result in by_reading.items()})
    judged[BEST_ANGLE] += [
        f"{reading}; the step nearest to the mean of the best angles"
        for reading, result in by_reading.items()
        if nearest_step_deg(result) == 29
    ]
    judged[STEEPEST] += [
        f"{reading}; rise in degrees"
        for reading, result in by_reading.items()
        if _largest(result, np.ptp(_chosen(result), axis=1), 3, "CCONVEX", "QUCAVE")
    ]
    return judged


def nearest_step_deg(result: CoarseResult) -> int:
    """The paper chooses 29 degrees as "most close to the average minimum error", after it gave 32.2 as the mean."""
    mean = result.mean_best_angle_rad()
    return round(degrees(min(result.groups.angles_rad, key=lambda angle: abs(angle - mean))))


def _chosen(result: CoarseResult) -> Array:
    """Return Top1, rad, by object and angle under the number of lights that the paper chose."""
    return np.asarray(result.errors_rad[:, result.row(CHOSEN_NUMBER), :, 2])


def _falls_and_rises(result: CoarseResult) -> bool:
    curve = result.mean_top1_rad[result.row(CHOSEN_NUMBER)]
    lowest = int(curve.argmin())
    return bool((np.diff(curve[: lowest + 1]) < 0).all() and (np.diff(curve[lowest:]) > 0).all())


def _flat_beyond_12(result: CoarseResult) -> bool:
    means = result.map_mean_by_number()
    return bool(means[3] > 1.3 and means[max(means)] > 0.85)


def _angle_beyond_number(result: CoarseResult) -> bool:
    by_angle = result.mean_top1_rad[result.row(CHOSEN_NUMBER)]
    by_number = result.mean_top1_rad[:, result.groups.angles_rad.index(result.best_angle_rad())]
    return bool(by_angle.max() / by_angle.min() > by_number.max() / by_number.min())


def _blue(result: CoarseResult) -> NDArray[np.integer]:
    """Return the number of cells under 5 degrees by object."""
    return np.asarray((result.errors_rad[..., 2] < np.radians(5)).sum(axis=(1, 2)))


def _red(result: CoarseResult) -> NDArray[np.integer]:
    return np.asarray((result.errors_rad[..., 2] > np.radians(30)).sum(axis=(1, 2)))


def _of(result: CoarseResult, values: NDArray[np.floating | np.integer], name: str) -> float:
    return float(values[result.names.index(name)])


def _largest(result: CoarseResult, values: NDArray[np.floating | np.integer], count: int, *names: str) -> bool:
    """Return whether `names` are all among the `count` largest values; one that equals the last of them counts."""
    return all(_of(result, values, name) >= np.sort(values)[-count] for name in names)


def _low_frequency(result: CoarseResult) -> bool:
    floor = _chosen(result).min(axis=1)
    return abs(_of(result, floor, "BSWAVE") / _of(result, floor, "SINWAVE") - 1) < 0.25


BEST_ANGLE = "the incident angle is 29°, closest to the average minimum"
STEEPEST = "CCONVEX and QUCAVE degrade most with the angle"
COARSE: dict[str, Callable[[CoarseResult], bool]] = {
    BEST_ANGLE: lambda r: abs(degrees(r.best_angle_rad()) - 29) < 0.5,
    "the best angle averaged over the benchmark is 32.2°": lambda r: (
        abs(degrees(r.mean_best_angle_rad()) - 32.2) < 0.05
    ),
    "the error first falls, then rises with the incident angle": _falls_and_rises,
    "the best angle is almost the same for any number of lights": lambda r: (
        len({r.best_angle_rad(number) for number in r.groups.numbers}) == 1
    ),
    "the error falls with the number of lights and is flat beyond 12": _flat_beyond_12,
    "the incident angle changes the error more than the number of lights": _angle_beyond_number,
    "SCROWN and SINWAVE have a large blue region": lambda r: _largest(r, _blue(r), 4, "SCROWN", "SINWAVE"),
    "the red region grows with the complexity of the surface, as of the caves and CCONVEX": lambda r: _largest(
        r, _red(r), 3, "BALLCAVE", "CCONVEX"
    ),
    "a simple form with a sharp step, TSTEP, has a large error": lambda r: (
        _of(r, _blue(r), "TSTEP") < min(_of(r, _blue(r), "SCROWN"), _of(r, _blue(r), "SINWAVE"))
    ),
    "the low-frequency sphere under BSWAVE hardly matters beside SINWAVE": _low_frequency,
    STEEPEST: lambda r: _largest(r, _chosen(r).max(axis=1) / _chosen(r).min(axis=1), 3, "CCONVEX", "QUCAVE"),
}


# ---- sections 3.1.2 and 3.2.2: height and plane ----


def fine_readings(geometry: SensorGeometry) -> dict[str, tuple[SensorGeometry, fine.View]]:
    """Return the readings of the fine stage: over what the plane is judged, and by which beam of the LEDs."""
    views = {
        "disc of 35 mm, linear picture": fine.View(),
        "whole gel, encoded picture": fine.View(diameter_mm=geometry.gel_diameter_mm, camera=ENCODED),
        "equation 3 as printed, without 1/d²": fine.View(falloff=False),
    }
    beams = {f"beam of {degrees(geometry.beam_angle_rad):.0f}°": geometry}
    if geometry.beam_angle_rad != PAPER_BEAM_RAD:
        beams["beam of 160°, as section 3.1.2"] = replace(geometry, beam_angle_rad=PAPER_BEAM_RAD)
    return {f"{what}; {beam}": (sensor, view) for beam, sensor in beams.items() for what, view in views.items()}


def fine_judgements(setup: StudySetup) -> Judged:
    """Return the statements of sections 2.3, 3.1.2 and 3.2.2."""
    seen = {
        reading: (
            [fine.illumination(fine.at_height(sensor, height), view) for height in fine.HEIGHTS_MM],
            fine.illumination(fine.at_height(sensor, sensor.camera_height_mm / 2), view),
        )
        for reading, (sensor, view) in fine_readings(setup.geometry).items()
    }
    errors = mean_errors_deg(setup, fine.HEIGHTS_MM)
    heights = {
        DEFAULTS[2]: (errors["air"][LEAST_SQUARES],),
        "one exposure, any unbiased estimate, equal light, behind the window": (errors["window"][ANY_ESTIMATE],),
        "one exposure, any unbiased estimate, equal light, in air": (errors["air"][ANY_ESTIMATE],),
    }
    return _judged(PLANE, seen) | _judged({"a height of 20 mm is best": _20_mm_is_best}, heights)


def _rises_with_height(by_height: list[fine.Illumination], _: fine.Illumination) -> bool:
    below = [light for light in by_height if light.mounting_height_mm <= 32]
    return all((np.diff([getattr(light, name) for light in below]) > 0).all() for name in ("nsd", "saturation"))


def _half_saturated(by_height: list[fine.Illumination], _: fine.Illumination) -> bool:
    heights = np.array([light.mounting_height_mm for light in by_height])
    return abs(fine.height_of_saturation(heights, np.array([light.saturation for light in by_height])) - 20) < 3


def _20_mm_is_best(errors_deg: Array) -> bool:
    """At most a tenth worse than 8 mm: least squares take shadows for slopes, which are longest under flat light."""
    there = np.isfinite(errors_deg)  # within the window there is no room for LEDs
    near, low = (np.interp(height, np.array(fine.HEIGHTS_MM)[there], errors_deg[there]) for height in (20, 8))
    return bool(near <= 1.1 * low)


PLANE: dict[str, Callable[[list[fine.Illumination], fine.Illumination], bool]] = {
    "NSD is smaller, the colours paler, the farther the LEDs are from the gel": _rises_with_height,
    "SAT is about 50 % at 20 mm": _half_saturated,
    "the intensity falls with the height": lambda by_height, _: (
        max(by_height, key=lambda light: light.mean).mounting_height_mm <= 4
    ),
    "64.05 / 96.17 / 99.90 % of the pixels lie within 1, 2, 3 σ": lambda _, at_20: bool(
        np.abs(np.array(at_20.within_sigmas) - [0.6405, 0.9617, 0.9990]).max() < 0.05
    ),
    "the brightness changes by 15 grey levels, of a mean of 159.02, from the centre to the border": lambda _, at_20: (
        abs(at_20.span / (15 / 159.02) - 1) < 1 / 3
    ),
    "the standard deviation is 6.67 of a mean of 159.02": lambda _, at_20: abs(at_20.variation - 0.042) < 0.01,
}


# ---- section 2.3.2: equation 8 ----


def ball_judgements() -> Judged:
    """Return the statements around equation 8. 29° leave 61°: a misprint, or light that acrylic bends first."""
    acrylic = Medium(refractive_index=1.49, thickness_mm=ACRYLIC_MM)
    bent = refracted(PAPER_ANGLE_RAD, acrylic)
    incident = {"no refraction": (PAPER_ANGLE_RAD,), "bent by acrylic of index 1.49": (bent,)}
    return _judged(BALL, incident)


BALL: dict[str, Callable[[float], bool]] = {
    "a ball of 4 mm pressed by 2 mm records 60°": lambda _: abs(degrees(maximum_elevation(4.0, 2.0)) - 60) < 1e-9,
    "at 29° shadows begin at slopes of 71°": lambda angle: abs(90 - degrees(angle) - 71) < 0.5,
}
