"""Designs beside the given sensor: the study, and its answer."""

from dataclasses import dataclass, replace
from math import degrees
from typing import Any

from gellight.base.errors import InputError
from gellight_design import parts
from gellight_design.simulating.geometry_file import outer_radius_mm, ring_colours
from gellight_design.studies import StudySetup, design_study, given_study
from gellight_design.sweep import Study
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import design
from sim_reference.optimizer.ball import shadow_free_slope
from sim_reference.optimizer.design import Candidate


@dataclass(frozen=True)
class DesignResult:
    """The best design with each number of LEDs, and the given sensor judged alike."""

    candidates: list[Candidate]
    given: Candidate

    @property
    def chosen(self) -> Candidate:
        """The candidate with the fewest LEDs whose Top1 is within a tenth of the best."""
        return design.chosen(self.candidates, "top1")


def full_design_study(setup: StudySetup, wanted: design.Requirements) -> Study[DesignResult]:
    """Return the study of designs that fulfil `wanted`, beside the given sensor."""
    candidates, given = design_study(setup, wanted), given_study(setup, wanted)
    first = len(candidates.tasks)
    return Study(
        [*candidates.tasks, *given.tasks],
        lambda found: DesignResult(candidates.combine(found[:first]), given.combine(found[first:])),
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
    over = outer_radius_mm(ring) - geometry.gel_diameter_mm / 2
    return replace(ring, ring_radius_mm=geometry.ring_radius_mm - max(over, 0.0))


def design_json(result: DesignResult, geometry: SensorGeometry) -> dict[str, Any]:
    """Return all candidates and the chosen one, and the given sensor judged alike."""
    ring = designed(result.chosen, geometry)
    return {
        "chosen": candidate_json(result.chosen),
        "candidates": [candidate_json(one) for one in result.candidates],
        "given": candidate_json(result.given),
        "ring_radius_mm": round(ring.ring_radius_mm, 4),
        "ring_colours": ring_colours(ring),
        "shadow_free_deg": {
            "given": round(degrees(shadow_free_slope(geometry)), 4),
            "chosen": round(degrees(shadow_free_slope(ring)), 4),
        },
    }


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
    """Return a line for the given sensor, for each candidate, for the choice, and for its shadow."""
    given, chosen = (
        f"{degrees(shadow_free_slope(sensor)):.1f}" for sensor in (geometry, designed(result.chosen, geometry))
    )
    return "\n".join(
        [
            f"given:  {design.describe(result.given)}",
            *(f"        {design.describe(one)}" for one in result.candidates),
            f"chosen: {design.describe(result.chosen)}",
            f"in the middle of the gel slopes beyond {chosen} degrees lie in the shadow of an LED ({given} as given)",
        ]
    )
