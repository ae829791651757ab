"""Labels under faults on virtual time: all are judged, and what goes wrong is noticed: each weakness is planted."""

from pathlib import Path

import pytest

from gellight.sensor.lighting.clock import ClockMap, Interval
from tests.soak.__main__ import labels_alone
from tests.soak.faults import FaultKind, PlannedFault
from tests.soak.judging import Invariant
from tests.soak.labelling import Labelling
from tests.soak.pressed_gel import PressedGel
from tests.soak.run import soak_bundle

pytestmark = pytest.mark.nightly


def suffer(folder: Path, *kinds: FaultKind, seconds: float = 1.0) -> Labelling:
    labelling = Labelling(0, folder / "bus", soak_bundle(folder / "bundle", PressedGel()))
    labelling.run([PlannedFault(60.0 * number, kind, seconds, 0.9) for number, kind in enumerate(kinds)])
    return labelling


def broken(labelling: Labelling) -> set[Invariant]:
    return {violation.invariant for violation in labelling.judge.violations}


def test_labels_are_judged_and_each_run_is_the_same(tmp_path: Path) -> None:
    runs = [suffer(tmp_path / name, FaultKind.BROWN_OUT, FaultKind.CORRUPT_PACKETS) for name in ("one", "two")]
    assert [broken(run) for run in runs] == [set(), set()]
    first, second = ((run.judge.frames, run.judge.labels, run.slowest_s) for run in runs)
    assert first == second
    assert first[1] > first[0] / 2
    assert labels_alone(runs[0]) == 0


def test_lights_that_are_told_too_late_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offset_us, late_us = ClockMap.offset_us, 40_000
    monkeypatch.setattr(ClockMap, "offset_us", lambda *asked: Interval(*(us - late_us for us in offset_us(*asked))))
    assert Invariant.LABEL in broken(suffer(tmp_path))
