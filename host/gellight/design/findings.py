"""All studies of a sensor, as the report shows them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.design import answers, comparison, comparison_coarse, designs, parts, studies
from gellight.design.comparison import Statement
from gellight.design.designs import Gain
from gellight.design.studies import FineResult, Subject
from gellight.design.sweep import Way
from gellight.design.sweep_times import SweepTimes, time_sweep
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import ball, design, fine
from sim_reference.optimizer.coarse import CoarseResult
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.optimizer.sensitivity import Variant

Array = NDArray[np.float64]
NUMBERS = (6, 9, 12, 15)
"""of LEDs that are designed for where they fit, besides those of the given sensor"""
BALL_PRESS_MM = 2.0
BALL_PRESS_SHARE = 0.4
"""of the gel's thickness, where that is less"""


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Everything the page shows."""

    subject: Subject
    coarse: CoarseResult
    fine: FineResult
    balls: tuple[ball.BallChoice, dict[float, Array]]
    beyond: dict[str, Array]
    given: design.Candidate
    """the given sensor, every LED by itself"""
    designs: list[design.Candidate]
    one_shot_given: design.Candidate
    one_shot_designs: list[design.Candidate]
    bright_designs: list[design.Candidate]
    """exposed as long as it takes"""
    sensitivity: list[tuple[Variant, float, float]]
    times: SweepTimes | None

    @property
    def chosen(self) -> design.Candidate:
        """The design with as many LEDs as the given sensor, for its firmware drives that many; else the best."""
        same = [one for one in self.designs if one.number == len(self.subject.geometry.led_colours)]
        return same[0] if same else design.chosen(self.designs, "top1")

    @property
    def chosen_sensor(self) -> SensorGeometry:
        """The sensor with the chosen ring."""
        return designs.designed(self.chosen, self.subject.geometry)

    def gains(self) -> list[Gain]:
        """Return what each step beyond the paper gains."""
        return designs.gains(self.beyond, self.given, self.chosen)

    def statements(self) -> list[Statement]:
        """Return the paper, line by line."""
        return [
            *comparison_coarse.coarse_statements(self.coarse),
            *comparison.fine_statements(self.fine, self.subject.geometry),
            *comparison.ball_statements(),
        ]


def find(subject: Subject, way: Way, *, timed: bool, numbers: tuple[int, ...] = NUMBERS) -> Findings | None:
    """Run all studies, those of `way`'s shard that the store does not hold; None while others are missing.

    Raises InputError or ConfigError for a sensor that cannot be studied, before anything is computed.
    """
    geometry, groups = subject.geometry, subject.seen_by(LightGroups())
    own = len(geometry.led_colours) // 3 * 3
    several = tuple(sorted({own, *(number for number in numbers if parts.fits(number, geometry))}))
    alike = designs.wishes(several, geometry, noise_grey=subject.noise_grey)
    at_once = designs.wishes((own,), geometry, one_shot=True, noise_grey=subject.noise_grey)
    bright = designs.wishes((own,), geometry, noise_grey=subject.noise_grey, exposure_limit=float("inf"))
    balls = answers.ball_choice(geometry, min(BALL_PRESS_MM, BALL_PRESS_SHARE * geometry.gel_thickness_mm), None)
    found: Mapping[str, Any] = {
        "coarse": studies.coarse_study(subject, groups, way),
        "fine": studies.fine_study(subject, _heights(geometry), way),
        "beyond": studies.beyond_study(subject, way),
        "given": studies.given_study(subject, alike, way),
        "designs": studies.design_study(subject, alike, way),
        "one_shot_given": studies.given_study(subject, at_once, way),
        "one_shot_designs": studies.design_study(subject, at_once, way),
        "bright_designs": studies.design_study(subject, bright, way),
        "sensitivity": studies.sensitivity_study(subject, way),
    }
    if any(study is None for study in found.values()):
        return None
    return Findings(subject=subject, balls=balls, times=time_sweep(subject, way, groups) if timed else None, **found)


def _heights(geometry: SensorGeometry) -> tuple[float, ...]:
    """Return the paper's heights, as far as the LEDs stay above the gel surface."""
    return tuple(height for height in fine.HEIGHTS_MM if height <= 0.9 * geometry.camera_height_mm)
