"""A design: beside the sensor it began with, with what each step beyond the paper gains, and with its parts."""

from dataclasses import asdict, dataclass, replace
from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.design import drawings, parts
from gellight.design.answers import Files
from gellight.design.geometry import STRIP_WIDTH_MM, design_file, outer_radius_mm, ring_colours
from gellight.design.studies import BEYOND_ANGLES
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import design
from sim_reference.optimizer.design import Candidate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gain:
    """What one step beyond the paper changes, in degrees of Top1 over the benchmark."""

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


def wishes(
    numbers: tuple[int, ...],
    geometry: SensorGeometry,
    *,
    one_shot: bool = False,
    noise_grey: float = 1.0,
    exposure_limit: float = 1.0,
) -> design.Wishes:
    """Return what a design has to do; raises InputError for what no design can, ConfigError for LEDs without room."""
    try:
        wanted = design.Wishes(
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


def gains(beyond: dict[str, Array], given: Candidate, best: Candidate) -> list[Gain]:
    """Return what each step beyond the paper gains; arguments as of `studies.beyond_study` and two candidates."""
    plain, aware, window = (
        np.degrees(beyond[name][:, 2]) for name in ("least squares", "shadows dropped", "window, same lamps")
    )
    angles = [f"{degrees(angle):.0f}" for angle in BEYOND_ANGLES]
    one, four = (float(np.degrees(beyond[name][0, 2])) for name in ("one exposure", four_exposures(beyond)))
    return [
        Gain(
            "shadowed observations dropped",
            f"each at its best angle, {angles[plain.argmin()]}° and {angles[aware.argmin()]}°",
            float(plain.min()),
            float(aware.min()),
        ),
        Gain(
            "refraction and Fresnel losses known",
            f"behind the window: at {angles[plain.argmin()]}° in air, best without a window, and at "
            f"{angles[window.argmin()]}°, best with it",
            float(window[plain.argmin()]),
            float(window.min()),
        ),
        Gain(
            f"{four_exposures(beyond)} of three LEDs",
            "one exposure in three colours, parallel light at 29°",
            one,
            four,
        ),
        Gain(
            "angle, height and exposure searched together",
            f"the given sensor with {given.number} LEDs and the design with {best.number}, read in the same way",
            degrees(given.top1_rad),
            degrees(best.top1_rad),
        ),
    ]


def four_exposures(beyond: dict[str, Array]) -> str:
    """Return the name of the scheme that lights three LEDs at a time: four exposures of twelve LEDs."""
    return next(name for name in beyond if name.endswith("exposures"))


def design_answer(
    candidates: list[Candidate], given: Candidate, beyond: dict[str, Array], geometry: SensorGeometry
) -> dict[str, Any]:
    """Return all candidates and the chosen one, the given sensor judged alike, and the gains."""
    best = design.chosen(candidates, "top1")
    ring = designed(best, geometry)
    return {
        "chosen": candidate_answer(best),
        "candidates": [candidate_answer(one) for one in candidates],
        "given": candidate_answer(given),
        "gains": [gain_answer(one) for one in gains(beyond, given, best)],
        "ring_radius_mm": round(ring.ring_radius_mm, 4),
        "ring_colours": ring_colours(ring),
    }


def gain_answer(gain: Gain) -> dict[str, Any]:
    """Return a gain with its figures rounded."""
    rounded = {name: round(value, 4) if isinstance(value, float) else value for name, value in asdict(gain).items()}
    return {**rounded, "factor": round(gain.factor, 3)}


def candidate_answer(one: Candidate) -> dict[str, Any]:
    """Return a candidate, angles in degrees."""
    return {
        "leds": one.number,
        "incident_angle_deg": round(degrees(one.incident_angle_rad), 4),
        "mounting_height_mm": round(one.mounting_height_mm, 2),
        "brightest_grey": round(one.brightest_grey, 1),
        "mae_deg": round(degrees(one.mae_rad), 4),
        "top1_deg": round(degrees(one.top1_rad), 4),
        "noise_mae_deg": round(degrees(one.noise_mae_rad), 4),
    }


def design_text(candidates: list[Candidate], given: Candidate, beyond: dict[str, Array]) -> str:
    """Return a line for the given sensor, for each candidate, for the choice and for each gain."""
    best = design.chosen(candidates, "top1")
    return "\n".join(
        [
            f"given:  {design.describe(given)}",
            *(f"        {design.describe(one)}" for one in candidates),
            f"chosen: {design.describe(best)}",
            "what each step beyond the paper gains in Top1:",
            *(f"  {one.in_words()} ({one.compared})" for one in gains(beyond, given, best)),
        ]
    )


def design_parts(candidates: list[Candidate], geometry: SensorGeometry) -> Files:
    """Return the parts of the chosen design."""
    return parts_of(designed(design.chosen(candidates, "top1"), geometry))


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
