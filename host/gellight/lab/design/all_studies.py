"""All studies of a sensor, as the report shows them, and the time that the coarse one takes."""

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.lab.design import comparison, comparison_coarse, designs, output, parts, studies
from gellight.lab.design.comparison import Judgement
from gellight.lab.design.designs import DesignResult, Gain
from gellight.lab.design.gel_comparison import GelRow, gel_study
from gellight.lab.design.output import BallResult
from gellight.lab.design.studies import BeyondResult, FineResult, Setup, VariantResult
from gellight.lab.simulator.sweep import Study, SweepOptions, executor, run_all, run_study
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import coarse, design, fine, plain
from sim_reference.optimizer.benchmark import PressedObject
from sim_reference.optimizer.coarse import CoarseResult
from sim_reference.optimizer.exposing import LightGroups

NUMBERS = (6, 9, 12, 15)
"""of LEDs that are designed for where they fit, besides those of the given sensor"""
BALL_PRESS_MM = 2.0
BALL_PRESS_SHARE = 0.4
"""of the gel's thickness, where that is less"""


@dataclass(frozen=True)
class SweepTimes:
    """Times of the sweep ("shared") and of the plain code on the same objects, and how far their errors differ."""

    size_px: int
    objects: int
    configurations: int
    workers: int
    shared_s: float
    plain_s: float
    shared_cpu_s: float
    plain_cpu_s: float
    largest_difference_deg: float

    @property
    def ratio(self) -> float:
        """How many times faster the sweep is, in wall-clock time."""
        return self.plain_s / self.shared_s

    def in_words(self) -> str:
        """Return the comparison in two sentences."""
        return (
            f"{self.objects} objects × {self.configurations} configurations at {self.size_px} × {self.size_px} pixels, "
            f"the objects pressed beforehand: {self.shared_s:.1f} s on {self.workers} cores; plain NumPy, one "
            f"configuration at a time: {self.plain_s:.1f} s, {self.ratio:.1f} times as long (processor time "
            f"{self.shared_cpu_s:.1f} s and {self.plain_cpu_s:.1f} s). The errors differ by at most "
            f"{self.largest_difference_deg:.0e}°."
        )


@dataclass(frozen=True, kw_only=True)
class AllResults:
    """Everything the page shows."""

    setup: Setup
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
    setup: Setup, options: SweepOptions, *, timed: bool, gels: bool, numbers: tuple[int, ...] = NUMBERS
) -> AllResults:
    """Run all studies in one sweep; `timed` adds the timing of the coarse sweep, `gels` the finite elements.

    Raises InputError or ConfigError for a sensor that cannot be studied, before anything is computed, and
    SweepIncomplete while other shards are missing.
    """
    geometry, groups, noise = setup.geometry, setup.with_noise(LightGroups()), setup.noise_grey
    own = setup.led_count // 3 * 3
    several = tuple(sorted({own, *(number for number in numbers if parts.fits(number, geometry))}))
    alike = designs.requirements(several, geometry, noise_grey=noise)
    at_once = designs.requirements((own,), geometry, one_shot=True, noise_grey=noise)
    bright = designs.requirements((own,), geometry, noise_grey=noise, exposure_limit=float("inf"))
    ball = output.ball_study(geometry, min(BALL_PRESS_MM, BALL_PRESS_SHARE * geometry.gel_thickness_mm), None)
    coarse, readings = studies.coarse_study(setup, groups), studies.coarse_readings(setup, groups)
    beyond = studies.beyond_study(setup)
    # The paper's heights, as far as the LEDs stay above the gel surface.
    heights_mm = tuple(height for height in fine.HEIGHTS_MM if height <= 0.9 * geometry.camera_height_mm)
    heights = studies.fine_study(setup, heights_mm)
    given, one_shot_given = (studies.given_study(setup, requirements) for requirements in (alike, at_once))
    best, one_shot_best, bright_best = (
        studies.design_study(setup, requirements) for requirements in (alike, at_once, bright)
    )
    sensitivity = studies.sensitivity_study(setup)
    gel = gel_study(setup if gels else replace(setup, names=()))
    every: tuple[Study[Any], ...] = (
        coarse, readings, heights, beyond, given, best, one_shot_given, one_shot_best, bright_best, sensitivity, gel,
    )  # fmt: skip
    run_all([task for study in every for task in study.tasks], options)
    return AllResults(
        setup=setup,
        coarse=run_study(coarse, options),
        readings=run_study(readings, options),
        fine=run_study(heights, options),
        ball=ball,
        beyond=run_study(beyond, options),
        given=run_study(given, options),
        designs=run_study(best, options),
        one_shot_given=run_study(one_shot_given, options),
        one_shot_designs=run_study(one_shot_best, options),
        bright_designs=run_study(bright_best, options),
        sensitivity=run_study(sensitivity, options),
        gel=run_study(gel, options),
        times=time_sweep(setup, options, groups) if timed else None,
    )


def time_sweep(setup: Setup, options: SweepOptions, groups: LightGroups) -> SweepTimes:
    """Time the sweep on all workers, which are warm, and the plain code on one."""
    pressed = [setup.pressed(name, setup.sampling) for name in setup.names]
    with executor(options) as pool:
        twice = 2 * options.workers  # tasks, so that every worker has had one
        _evaluated(pool, pressed[:1] * twice, replace(groups, numbers=(3,)))
        start = time.perf_counter()
        shared = _evaluated(pool, pressed, groups)
        shared_s = time.perf_counter() - start
    start, start_cpu = time.perf_counter(), time.process_time()
    plainly = [plain.evaluate(one, groups) for one in pressed]
    plain_s, plain_cpu_s = time.perf_counter() - start, time.process_time() - start_cpu
    difference = max(float(np.abs(errors - slowly).max()) for (errors, _), slowly in zip(shared, plainly, strict=True))
    counts = setup.sampling.size_px, len(pressed), len(groups.numbers) * len(groups.angles_rad), options.workers
    shared_cpu_s = sum(cpu for _, cpu in shared)
    return SweepTimes(*counts, shared_s, plain_s, shared_cpu_s, plain_cpu_s, float(np.degrees(difference)))


def _evaluated(
    pool: Executor, pressed: Sequence[PressedObject], groups: LightGroups
) -> list[tuple[NDArray[np.float64], float]]:
    """Return `_shared` of each. Not by `map`, which cancels when it is interrupted: see `executor`."""
    futures = [pool.submit(_shared, one, groups) for one in pressed]
    return [future.result() for future in futures]


def _shared(pressed: PressedObject, groups: LightGroups) -> tuple[NDArray[np.float64], float]:
    start = time.process_time()
    return coarse.evaluate(pressed, groups), time.process_time() - start
