"""Designs beside the given sensor: the study, the gain of each step beyond the paper, and the parts to make."""

from dataclasses import asdict, dataclass, replace
from math import degrees
from typing import Any

import numpy as np

from gellight.base.errors import InputError
from gellight.lab.design import drawings, parts
from gellight.lab.design.geometry import STRIP_WIDTH_MM, design_file, outer_radius_mm, ring_colours
from gellight.lab.design.output import Files
from gellight.lab.design.studies import BEYOND_ANGLES, BeyondResult, StudySetup, beyond_study, design_study, given_study
from gellight.lab.simulator.sweep import Study
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import design
from sim_reference.optimizer.ball import shadow_free_slope
from sim_reference.optimizer.design import Candidate


@dataclass(frozen=True)
class Gain:
    """Top1 of the benchmark in degrees before and after one step beyond the paper."""

    step: str
    compared: str
    before_deg: float
    after_deg: float

    @property
    def factor(self) -> float:
        """How many times lower the error is."""
        return self.before_deg / self.after_deg

    def in_words(self) -> str:
        """Return the gain as a line."""
        return f"{self.step}: {self.before_deg:.2f} -> {self.after_deg:.2f} degrees, {self.factor:.2f} times lower"


@dataclass(frozen=True)
class DesignResult:
    """The best design with each number of LEDs, the given sensor judged alike, and the methods beyond the paper."""

    candidates: list[Candidate]
    given: Candidate
    beyond: BeyondResult

    @property
    def chosen(self) -> Candidate:
        """The candidate with the fewest LEDs whose Top1 is within a tenth of the best."""
        return design.chosen(self.candidates, "top1")


def full_design_study(setup: StudySetup, wanted: design.Requirements) -> Study[DesignResult]:
    """Return the study of designs that fulfil `wanted`, beside the given sensor and the methods beyond the paper."""
    candidates, given, beyond = design_study(setup, wanted), given_study(setup, wanted), beyond_study(setup)
    first, second = len(candidates.tasks), len(candidates.tasks) + len(given.tasks)
    return Study(
        [*candidates.tasks, *given.tasks, *beyond.tasks],
        lambda found: DesignResult(
            candidates.combine(found[:first]), given.combine(found[first:second]), beyond.combine(found[second:])
        ),
    )


def requirements(
    numbers: tuple[int, ...],
    geometry: SensorGeometry,
    *,
    one_shot: bool = False,
    noise_grey: float = 1.0,
    exposure_limit: float = 1.0,
) -> design.Requirements:
    """Return what a design must fulfil.

    Raises InputError for what no design can fulfil and for more LEDs than fit on the ring, ConfigError for a ring that
    does not fit into the housing.
    """
    try:
        wanted = design.Requirements(
            numbers=numbers,
            one_shot=one_shot,
            drop_shadows=not one_shot,
            noise_grey=noise_grey,
            exposure_limit=exposure_limit,
        )
    except ValueError as error:
        raise InputError(str(error)) from None
    for number in numbers:
        parts.strip(replace(geometry, led_colours=design.colours_of(number, geometry)))
    return wanted


def designed(candidate: Candidate, geometry: SensorGeometry) -> SensorGeometry:
    """Return the sensor with a candidate's ring; the radius is trimmed to the housing if the new tilt asks for it."""
    ring = replace(
        geometry,
        led_colours=design.colours_of(candidate.number, geometry),
        incident_angle_rad=round(candidate.incident_angle_rad, 4),
        mounting_height_mm=round(candidate.mounting_height_mm, 1),
    )
    over = outer_radius_mm(ring, STRIP_WIDTH_MM) - geometry.gel_diameter_mm / 2
    return replace(ring, ring_radius_mm=geometry.ring_radius_mm - max(over, 0.0))


def gains(result: DesignResult, best: Candidate) -> list[Gain]:
    """Return what each step beyond the paper gains, the last one by the design `best`."""
    plain, aware, window = (
        np.degrees(result.beyond.curves[name][:, 2])
        for name in ("least squares", "shadows dropped", "window, same lamps")
    )
    angles = [f"{degrees(angle):.0f}°" for angle in BEYOND_ANGLES]
    few = result.beyond.few_exposures
    one, four = (degrees(result.beyond.schemes[name][2]) for name in ("one exposure", few))
    given = result.given
    return [
        Gain(
            "shadowed observations dropped",
            f"each at its best angle, {angles[plain.argmin()]} and {angles[aware.argmin()]}",
            float(plain.min()),
            float(aware.min()),
        ),
        Gain(
            "refraction and Fresnel losses known",
            f"behind the window: at {angles[plain.argmin()]} in air, best without a window, and at "
            f"{angles[window.argmin()]}, best with it",
            float(window[plain.argmin()]),
            float(window.min()),
        ),
        Gain(f"{few} of three LEDs", "one exposure in three colours, parallel light at 29°", one, four),
        Gain(
            "angle, height and exposure searched together",
            f"the given sensor with {given.number} LEDs and the design with {best.number}, read in the same way",
            degrees(given.top1_rad),
            degrees(best.top1_rad),
        ),
    ]


def design_json(result: DesignResult, geometry: SensorGeometry) -> dict[str, Any]:
    """Return all candidates and the chosen one, the given sensor judged alike, and the gains."""
    ring = designed(result.chosen, geometry)
    return {
        "chosen": candidate_json(result.chosen),
        "candidates": [candidate_json(one) for one in result.candidates],
        "given": candidate_json(result.given),
        "gains": [gain_json(one) for one in gains(result, result.chosen)],
        "ring_radius_mm": round(ring.ring_radius_mm, 4),
        "ring_colours": ring_colours(ring),
        "shadow_free_deg": {
            "given": round(degrees(shadow_free_slope(geometry)), 4),
            "chosen": round(degrees(shadow_free_slope(ring)), 4),
        },
    }


def gain_json(gain: Gain) -> dict[str, Any]:
    """Return a gain with its figures rounded."""
    rounded = {name: round(value, 4) if isinstance(value, float) else value for name, value in asdict(gain).items()}
    return {**rounded, "factor": round(gain.factor, 3)}


def candidate_json(one: Candidate) -> dict[str, Any]:
    """Return a candidate, angles in degrees."""
    return {
        "leds": one.number,
        "incident_angle_deg": round(degrees(one.incident_angle_rad), 4),
        "mounting_height_mm": round(one.mounting_height_mm, 2),
        "brightest_grey": round(one.brightest_grey, 1),
        "mae_deg": round(degrees(one.mae_rad), 4),
        "top1_deg": round(degrees(one.top1_rad), 4),
        "noise_mae_deg": round(degrees(one.noise_mae_rad), 4),
        "evaluations": one.evaluations,
        "converged": one.converged,
    }


def design_text(result: DesignResult, geometry: SensorGeometry) -> str:
    """Return a line for the given sensor, for each candidate, for the choice, its shadow, and for each gain."""
    given, chosen = (
        f"{degrees(shadow_free_slope(sensor)):.1f}" for sensor in (geometry, designed(result.chosen, geometry))
    )
    return "\n".join(
        [
            f"given:  {design.describe(result.given)}",
            *(f"        {design.describe(one)}" for one in result.candidates),
            f"chosen: {design.describe(result.chosen)}",
            f"in the middle of the gel slopes beyond {chosen} degrees lie in the shadow of an LED ({given} as given)",
            "what each step beyond the paper gains in Top1:",
            *(f"  {one.in_words()} ({one.compared})" for one in gains(result, result.chosen)),
        ]
    )


def parts_of(geometry: SensorGeometry) -> Files:
    """Return the files to make a ring: strip as DXF and SVG, section, LED table, and the settings of the sensor."""
    flat = parts.strip(geometry)
    return {
        "gellight.toml": design_file(geometry),
        "strip.dxf": parts.strip_dxf(flat),
        "strip.svg": drawings.strip_svg(flat, geometry.led_colours),
        "ring.svg": drawings.ring_svg(geometry),
        "leds.csv": parts.led_table(geometry),
    }
