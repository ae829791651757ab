"""How much faster the coarse sweep is than plain code, and that both say the same."""

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.lab.design.studies import StudySetup
from gellight.lab.simulator.sweep import SweepOptions, executor
from sim_reference.optimizer import coarse, plain
from sim_reference.optimizer.benchmark import PressedObject
from sim_reference.optimizer.exposing import LightGroups


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


def time_sweep(setup: StudySetup, options: SweepOptions, groups: LightGroups) -> SweepTimes:
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
