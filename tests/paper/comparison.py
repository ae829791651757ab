"""The paper's statements on height and ball beside what was measured here; the numbers decide each verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, radians

import numpy as np

from sim_reference.geometry import ACRYLIC_MM, SensorGeometry
from sim_reference.metrics import maximum_elevation
from sim_reference.optimizer import fine
from sim_reference.refraction import Medium, refracted
from tests.paper.heights import EQUAL_LIGHT, FineResult

ENCODED = replace(fine.IDEAL_CAMERA, gamma=2.2)
PAPER_ANGLE_RAD = radians(29)
PAPER_BEAM_RAD = radians(160)
PAPER_SPAN = 15 / 159.02
HEIGHT_READINGS = {
    "one exposure, least squares, in air": ("air", "one exposure"),
    "one exposure, any unbiased estimate, equal light, behind the window": ("window", EQUAL_LIGHT),
    "one exposure, any unbiased estimate, equal light, in air": ("air", EQUAL_LIGHT),
}
"""medium and method of `FineResult.errors_deg`"""


@dataclass(frozen=True, kw_only=True)
class Statement:
    """One sentence of the paper, judged under one reading of its text."""

    section: str
    claim: str
    measured: str
    holds_if: str
    """the criterion, in words"""
    reproduced: bool
    why: str = ""


@dataclass(frozen=True)
class Judgement:
    """One sentence of the paper under every reading that its text allows; the first reading is that of the defaults."""

    by_reading: Mapping[str, Statement]

    @property
    def reproduced(self) -> bool:
        """Whether it holds under one of the readings."""
        return any(one.reproduced for one in self.by_reading.values())

    @property
    def by_default(self) -> Statement:
        """The sentence under the reading of the defaults."""
        return next(iter(self.by_reading.values()))

    @property
    def best(self) -> Statement:
        """The sentence under the first reading under which it holds; where there is none, that of the defaults."""
        return next((one for one in self.by_reading.values() if one.reproduced), self.by_default)

    @property
    def holds_under(self) -> list[str]:
        """The readings under which it holds."""
        return [reading for reading, one in self.by_reading.items() if one.reproduced]


def judged(by_reading: Mapping[str, Sequence[Statement]]) -> list[Judgement]:
    """Return the judgements of the same statements under several readings."""
    readings = list(by_reading)
    return [Judgement(dict(zip(readings, one, strict=True))) for one in zip(*by_reading.values(), strict=True)]


def summary(rows: Sequence[Judgement]) -> str:
    """Return how many statements hold and under which readings, in a sentence."""
    stages = [
        [row for row in rows if next(iter(row.by_reading)) == first]
        for first in dict.fromkeys(next(iter(row.by_reading)) for row in rows)
    ]
    counted = [_most_at_once(stage) for stage in stages]
    return (
        f"{sum(row.reproduced for row in rows)} of {len(rows)} statements of the paper are reproduced, each under a "
        f"reading that its text allows; {sum(count for count, _ in counted)} under one and the same reading of each "
        f"stage ({' / '.join(reading for _, reading in counted)}), "
        f"{sum(row.by_default.reproduced for row in rows)} under that of the defaults"
    )


def _most_at_once(stage: Sequence[Judgement]) -> tuple[int, str]:
    """Return how many statements hold under the reading that most of them hold under, and that reading."""
    counts = {reading: sum(reading in row.holds_under for row in stage) for reading in stage[0].by_reading}
    best = max(counts, key=lambda reading: counts[reading])
    return counts[best], best


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


def fine_judgements(result: FineResult, geometry: SensorGeometry) -> list[Judgement]:
    """Return the statements of sections 2.3, 3.1.2 and 3.2.2."""
    plane = {
        reading: _plane_statements(result.heights_mm, sensor, view)
        for reading, (sensor, view) in fine_readings(geometry).items()
    }
    return [*judged(plane), Judgement({reading: _best_height(result, reading) for reading in HEIGHT_READINGS})]


def _plane_statements(heights_mm: Sequence[float], geometry: SensorGeometry, view: fine.View) -> list[Statement]:
    light = [fine.illumination(fine.at_height(geometry, height), view) for height in heights_mm]
    at_20 = fine.illumination(fine.at_height(geometry, geometry.camera_height_mm / 2), view)
    return [_rises_with_height(light), _half_saturation(light, at_20), _intensity(light), *_uniformity(at_20)]


def _rises_with_height(by_height: Sequence[fine.Illumination]) -> Statement:
    below = [light for light in by_height if light.mounting_height_mm <= 32]
    nsd, sat = (np.array([getattr(light, name) for light in below]) for name in ("nsd", "saturation"))
    return Statement(
        section="3.1.2",
        claim="NSD is smaller, the colours paler, the farther the LEDs are from the gel",
        measured=f"NSD {nsd[0]:.2f} and SAT {sat[0]:.0%} at {below[0].mounting_height_mm:g} mm, {nsd[-1]:.2f} and "
        f"{sat[-1]:.0%} at {below[-1].mounting_height_mm:g} mm",
        holds_if="both rise over 0 to 32 mm",
        reproduced=bool((np.diff(nsd) > 0).all() and (np.diff(sat) > 0).all()),
        why="near the LEDs each colour falls off across the view; far away the three mix",
    )


def _half_saturation(by_height: Sequence[fine.Illumination], at_20: fine.Illumination) -> Statement:
    heights = np.array([light.mounting_height_mm for light in by_height])
    half = fine.height_of_saturation(heights, np.array([light.saturation for light in by_height]))
    return Statement(
        section="3.1.2",
        claim="SAT is about 50 % at 20 mm",
        measured=f"SAT is 50 % at {half:.1f} mm, and {at_20.saturation:.0%} at {at_20.mounting_height_mm:g} mm",
        holds_if="50 % within 3 mm of 20 mm",
        reproduced=abs(half - 20) < 3,
        why="the paper does not say over what SAT is taken, nor whether the picture is encoded (gamma)",
    )


def _intensity(by_height: Sequence[fine.Illumination]) -> Statement:
    peak = max(by_height, key=lambda light: light.mean).mounting_height_mm
    return Statement(
        section="3.1.2",
        claim="the intensity falls with the height",
        measured=f"the mean is largest at {peak:g} mm",
        holds_if="the peak at 4 mm or below",
        reproduced=peak <= 4,
        why="the LEDs come nearer, which equation 3 as printed leaves out; only beyond that does the beam miss the gel",
    )


def _uniformity(at_20: fine.Illumination) -> list[Statement]:
    return [
        Statement(
            section="3.2.2",
            claim="64.05 / 96.17 / 99.90 % of the pixels lie within 1, 2, 3 σ",
            measured=" / ".join(f"{share:.1%}" for share in at_20.within_sigmas),
            holds_if="each within 5 points",
            reproduced=bool(np.abs(np.array(at_20.within_sigmas) - [0.6405, 0.9617, 0.9990]).max() < 0.05),
            why="the shares follow the form of the distribution, not its width",
        ),
        Statement(
            section="3.2.2",
            claim="the brightness changes by 15 grey levels (about 5 % of 255) from the centre to the border",
            measured=f"largest less smallest over the mean: {at_20.span:.1%}",
            holds_if="within a third of 9.4 %: 15 of a mean of 159.02",
            reproduced=abs(at_20.span / PAPER_SPAN - 1) < 1 / 3,
            why="the paper does not say over what it is taken, and its figure is of a real sensor",
        ),
        Statement(
            section="3.2.2",
            claim="the standard deviation is 6.67 of a mean of 159.02 (4.2 %)",
            measured=f"{at_20.variation:.1%} for identical LEDs",
            holds_if="within a point of 4.2 %",
            reproduced=abs(at_20.variation - 0.042) < 0.01,
            why="the spread of real LEDs and noise add to it: they are not in the model",
        ),
    ]


def _best_height(result: FineResult, reading: str) -> Statement:
    errors = result.errors_deg(*HEIGHT_READINGS[reading])[:, 0]
    there = np.isfinite(errors)  # within the window there is no room for LEDs
    heights = np.array(result.heights_mm)[there]
    near, low = (float(np.interp(height, heights, errors[there])) for height in (20, 8))
    return Statement(
        section="3.1.2",
        claim="a height of 20 mm is best",
        measured=f"20 mm: MAE {near:.2f}°, 8 mm: {low:.2f}°",
        holds_if="20 mm at most a tenth worse than 8 mm",
        reproduced=near <= 1.1 * low,
        why="least squares take shadows for slopes, which are longest under LEDs far from the gel's normal; a trained "
        "map need not",
    )


def ball_judgements() -> list[Judgement]:
    """Return the statements around equation 8."""
    acrylic = Medium(refractive_index=1.49, thickness_mm=ACRYLIC_MM)
    incident = {"no refraction": PAPER_ANGLE_RAD, "bent by acrylic of index 1.49": refracted(PAPER_ANGLE_RAD, acrylic)}
    return judged({reading: [_elevation(), _shadow(degrees(angle))] for reading, angle in incident.items()})


def _elevation() -> Statement:
    elevation = degrees(maximum_elevation(4.0, 2.0))
    return Statement(
        section="2.3.2",
        claim="a ball of 4 mm pressed by 2 mm records 60°",
        measured=f"{elevation:.9f}°",
        holds_if="to 1e-9°",
        reproduced=abs(elevation - 60) < 1e-9,
        why="half the radius deep, the cosine of the angle is a half",
    )


def _shadow(incident_deg: float) -> Statement:
    return Statement(
        section="2.3.2",
        claim="at 29° shadows begin at slopes of 71°",
        measured=f"{90 - incident_deg:.2f}°",
        holds_if="90° less the incident angle is 71° to half a degree",
        reproduced=abs(90 - incident_deg - 71) < 0.5,
        why="29° leave 61°: a misprint, or light that acrylic bends first, which the paper's model does not contain",
    )
