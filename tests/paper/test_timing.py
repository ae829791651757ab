"""The timing of the coarse sweep: equal errors, and how many times faster."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.lab.simulator.sweep import SweepOptions
from sim_reference.optimizer import plain
from sim_reference.optimizer.exposing import LightGroups
from tests.helpers.studies import FEW, setup
from tests.paper.timing import SweepTimes, time_sweep


def test_the_timing_compares_equal_errors(options: SweepOptions) -> None:
    times = time_sweep(setup(48, FEW[:2]), replace(options, workers=2), LightGroups(numbers=(3, 6)))
    assert times.largest_difference_deg < 1e-6
    assert (times.objects, times.configurations, times.workers, times.size_px) == (2, 22, 2, 48)
    assert min(times.shared_s, times.plain_s, times.shared_cpu_s, times.plain_cpu_s) > 0


def test_the_timing_sees_a_difference(options: SweepOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    honest = plain.evaluate
    monkeypatch.setattr(plain, "evaluate", lambda pressed, groups: honest(pressed, groups) + np.radians([0, 0, 0.25]))
    times = time_sweep(setup(48, FEW[:1]), options, LightGroups(numbers=(3,), angles_rad=(0.5,)))
    assert times.largest_difference_deg == pytest.approx(0.25, abs=1e-6)


def test_the_timing_says_how_many_times_faster_the_sweep_is() -> None:
    times = SweepTimes(64, 10, 77, 2, shared_s=4, plain_s=12, shared_cpu_s=7, plain_cpu_s=11, largest_difference_deg=0)
    assert times.ratio == 3
    assert "4.0 s on 2 cores; plain NumPy, one configuration at a time: 12.0 s, 3.0 times as long" in times.in_words()
