"""Labels under faults on virtual time: all are judged, and what goes wrong is noticed: each weakness is planted."""

from dataclasses import replace
from pathlib import Path

import pytest

from gellight.frames.frames import CameraFrame
from gellight.sensor.lighting.clock import ClockMap, Interval
from gellight.sensor.lighting.light_watch import LightWatch
from gellight.sensor.v4l2.video_camera import V4l2Camera
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


def test_nothing_judged_is_no_pass(tmp_path: Path) -> None:
    labelling = Labelling(0, tmp_path / "bus", soak_bundle(tmp_path / "bundle", PressedGel()))
    assert labels_alone(labelling) == 1


def test_lights_that_are_told_too_late_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offset_us, late_us = ClockMap.offset_us, 40_000
    monkeypatch.setattr(ClockMap, "offset_us", lambda *asked: Interval(*(us - late_us for us in offset_us(*asked))))
    assert Invariant.LABEL in broken(suffer(tmp_path))


def test_labels_by_time_stamps_that_are_no_more_than_estimates_are_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = V4l2Camera.read

    def sure(camera: V4l2Camera) -> CameraFrame:
        return replace(read(camera), estimated=False)

    monkeypatch.setattr(V4l2Camera, "read", sure)
    assert Invariant.LABEL in broken(suffer(tmp_path, FaultKind.CAMERA_CLOCK))


def test_a_sequence_that_is_not_begun_again_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LightWatch, "silenced", lambda watch: False)
    monkeypatch.setattr("tests.soak.labelling.KEEP_ALIVE_S", 3.0)
    assert broken(suffer(tmp_path, FaultKind.STALL, seconds=1.5)) == {Invariant.RECOVERY}
