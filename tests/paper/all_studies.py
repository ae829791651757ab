"""All studies of a sensor, as the report shows them."""

from dataclasses import dataclass, replace
from typing import Any

from gellight.lab.design import designs, output, parts, studies
from gellight.lab.design.designs import DesignResult, Gain
from gellight.lab.design.output import BallResult
from gellight.lab.design.studies import BeyondResult, StudySetup
from gellight.lab.simulator.sweep import Study, SweepOptions, run_all, run_study
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import design, fine
from sim_reference.optimizer.coarse import CoarseResult
from sim_reference.optimizer.exposing import LightGroups
from tests.paper import comparison, comparison_coarse
from tests.paper.comparison import Judgement
from tests.paper.gel_comparison import GelRow, gel_study
from tests.paper.heights import FineResult, fine_study
from tests.paper.timing import SweepTimes, time_sweep
from tests.paper.variants import VariantResult, coarse_readings, sensitivity_study

NUMBERS = (6, 9, 12, 15)
"""of LEDs that are designed for where they fit, besides those of the given sensor"""
BALL_PRESS_MM = 2.0
BALL_PRESS_SHARE = 0.4
"""of the gel's thickness, where that is less"""


@dataclass(frozen=True, kw_only=True)
class AllResults:
    """Everything the page shows."""

    setup: StudySetup
    coarse: CoarseResult
    readings: dict[str, CoarseResult]
    """the coarse study under each reading of the paper's text"""
    fine: FineResult
    ball: BallResult
    beyond: BeyondResult
    given: design.Candidate
    """the given sensor, every LED by itself"""
    designs: list[design.Candidate]
    one_shot_given: design.Candidate
    one_shot_designs: list[design.Candidate]
    bright_designs: list[design.Candidate]
    """without a limit of the exposure"""
    sensitivity: list[VariantResult]
    gel: list[GelRow]
    """the layer against finite elements, empty if that was not asked for"""
    times: SweepTimes | None

    @property
    def chosen(self) -> design.Candidate:
        """The design with as many LEDs as the given sensor, for its firmware drives that many; else the best."""
        same = [one for one in self.designs if one.number == self.setup.led_count]
        return same[0] if same else design.chosen(self.designs, "top1")

    @property
    def chosen_sensor(self) -> SensorGeometry:
        """The sensor with the chosen ring."""
        return designs.designed(self.chosen, self.setup.geometry)

    def gains(self) -> list[Gain]:
        """Return what each step beyond the paper gains."""
        return designs.gains(DesignResult(self.designs, self.given, self.beyond), self.chosen)

    def judgements(self) -> list[Judgement]:
        """Return the paper, line by line, each line under its readings."""
        return [
            *comparison_coarse.coarse_judgements(self.readings),
            *comparison.fine_judgements(self.fine, self.setup.geometry),
            *comparison.ball_judgements(),
        ]


def run_all_studies(
    setup: StudySetup, options: SweepOptions, *, timed: bool, gels: bool, numbers: tuple[int, ...] = NUMBERS
) -> AllResults:
    """Run all studies in one sweep; `timed` adds the timing of the coarse sweep, `gels` the finite elements.

    Raises InputError or ConfigError for a sensor that cannot be studied, before anything is computed, and
    SweepIncomplete while other shards are missing.
    """
    geometry, groups = setup.geometry, setup.with_noise(LightGroups())
    ball = output.ball_study(geometry, min(BALL_PRESS_MM, BALL_PRESS_SHARE * geometry.gel_thickness_mm), None)
    # The paper's heights, as far as the LEDs stay above the gel surface.
    heights_mm = tuple(height for height in fine.HEIGHTS_MM if height <= 0.9 * geometry.camera_height_mm)
    every: dict[str, Study[Any]] = {
        "coarse": studies.coarse_study(setup, groups),
        "readings": coarse_readings(setup, groups),
        "fine": fine_study(setup, heights_mm),
        "beyond": studies.beyond_study(setup),
        **_design_studies(setup, numbers),
        "sensitivity": sensitivity_study(setup),
        "gel": gel_study(setup if gels else replace(setup, names=())),
    }
    run_all([task for study in every.values() for task in study.tasks], options)
    found = {name: run_study(study, options) for name, study in every.items()}
    times = time_sweep(setup, options, groups) if timed else None
    return AllResults(setup=setup, ball=ball, times=times, **found)


def _design_studies(setup: StudySetup, numbers: tuple[int, ...]) -> dict[str, Study[Any]]:
    """Return the studies of the given ring and of the best ones, by the field of `AllResults` that they fill."""
    geometry, noise = setup.geometry, setup.noise_grey
    own = setup.led_count // 3 * 3
    several = tuple(sorted({own, *(number for number in numbers if parts.fits(number, geometry))}))
    alike = designs.requirements(several, geometry, noise_grey=noise)
    at_once = designs.requirements((own,), geometry, one_shot=True, noise_grey=noise)
    bright = designs.requirements((own,), geometry, noise_grey=noise, exposure_limit=float("inf"))
    return {
        "given": studies.given_study(setup, alike),
        "designs": studies.design_study(setup, alike),
        "one_shot_given": studies.given_study(setup, at_once),
        "one_shot_designs": studies.design_study(setup, at_once),
        "bright_designs": studies.design_study(setup, bright),
    }
