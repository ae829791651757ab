"""Time of the coarse sweep, beside plain code that computes one light group, one light, one picture at a time."""

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.design.studies import Setup
from gellight.design.sweep import SweepOptions, executor
from sim_reference.optimizer import coarse, plain
from sim_reference.optimizer.benchmark import PressedObject, press_benchmark
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


def time_sweep(setup: Setup, options: SweepOptions, groups: LightGroups) -> SweepTimes:
    """Time the sweep on all workers, which are warm, and the plain code on one."""
    pressed = [press_benchmark(name, setup.sampling, setup.geometry, setup.parameters) for name in setup.names]
    with executor(options) as pool:
        list(
            pool.map(_shared, pressed[:1] * 2 * options.workers, [replace(groups, numbers=(3,))] * 2 * options.workers)
        )
        start = time.perf_counter()
        shared = list(pool.map(_shared, pressed, [groups] * len(pressed)))
        shared_s = time.perf_counter() - start
    start, start_cpu = time.perf_counter(), time.process_time()
    plainly = [plain.evaluate(one, groups) for one in pressed]
    plain_s, plain_cpu_s = time.perf_counter() - start, time.process_time() - start_cpu
    difference = max(float(np.abs(errors - slowly).max()) for (errors, _), slowly in zip(shared, plainly, strict=True))
    return SweepTimes(
        setup.sampling.size_px,
        len(pressed),
        len(groups.numbers) * len(groups.angles_rad),
        options.workers,
        shared_s,
        plain_s,
        sum(cpu for _, cpu in shared),
        plain_cpu_s,
        float(np.degrees(difference)),
    )


def _shared(pressed: PressedObject, groups: LightGroups) -> tuple[NDArray[np.float64], float]:
    start = time.process_time()
    return coarse.evaluate(pressed, groups), time.process_time() - start
