"""Some minutes of faults, and that the soak notices a product that does not stand them: each weakness is planted."""

import resource
import tempfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from gellight.base.errors import InputError
from gellight.ring.light_ring import LightRing
from gellight.sensor.connection import Connection
from gellight.sensor.sensor_camera import SensorCamera
from gellight.sensor.v4l2 import video_camera
from tests.soak import shift
from tests.soak.faults import FaultKind, PlannedFault, plan
from tests.soak.judging import Invariant
from tests.soak.run import RECOVERY_S, Report, Soak, soak

SEED = 2026
HOURS = 0.4
pytestmark = pytest.mark.timeout(600)


@pytest.fixture(autouse=True)
def home(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with tempfile.TemporaryDirectory() as folder:
        monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
        yield


def suffer(tmp_path: Path, *kinds: FaultKind, seconds: float = 1.0) -> Report:
    faults = [PlannedFault(60.0 * number, kind, seconds, 1.0) for number, kind in enumerate(kinds)]
    return Soak(0, tmp_path, print).run(iter(faults))


def broken(report: Report) -> set[Invariant]:
    return {violation.invariant for violation in report.violations}


def test_everything_holds_under_faults_drawn_at_random() -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    report = soak(SEED, HOURS, print)
    assert broken(report) == set()
    assert set(report.faults) == set(FaultKind), "every kind of fault was made"
    assert report.frames > 500
    assert resource.getrlimit(resource.RLIMIT_FSIZE) == limits


def test_a_plan_is_the_same_for_the_same_seed_and_has_about_a_fault_a_minute() -> None:
    faults = list(plan(1, 8.0))
    assert faults == list(plan(1, 8.0)) != list(plan(2, 8.0))
    assert 400 < len(faults) < 560
    assert {fault.kind for fault in faults[: len(FaultKind)]} == set(FaultKind)


def test_a_run_without_a_fault_is_refused() -> None:
    with pytest.raises(InputError, match="no fault of seed 2 falls into"):
        soak(2, next(plan(2, 8.0)).at_s / 3600 * 0.9)


def test_dark_frames_after_a_brown_out_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Connection, "_watch", lambda self: None)
    monkeypatch.setattr(LightRing, "lit_since_s", lambda self: self.lit_s)  # else the board is asked in time
    assert Invariant.LIGHT in broken(suffer(tmp_path, FaultKind.BROWN_OUT))


def test_pictures_that_are_delivered_twice_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video_camera, "BLANK_GREY", 256)
    assert Invariant.FRESH in broken(suffer(tmp_path, FaultKind.DUPLICATED, seconds=2.0))


def test_a_slow_recovery_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = SensorCamera._return

    def slow(camera: SensorCamera) -> None:
        camera._closing.wait(5.0)
        find(camera)

    monkeypatch.setattr(SensorCamera, "_return", slow)
    assert broken(suffer(tmp_path, FaultKind.UNPLUGGED)) == {Invariant.RECOVERY}


def test_a_daemon_that_ends_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(camera: SensorCamera) -> None:
        raise RuntimeError("planted")

    monkeypatch.setattr(SensorCamera, "_return", fail)
    monkeypatch.setattr("tests.soak.run.GIVE_UP_S", 2 * RECOVERY_S)  # it never comes back
    assert {Invariant.RUNNING, Invariant.RECOVERY} <= broken(suffer(tmp_path, FaultKind.UNPLUGGED))


def test_leds_that_shine_on_without_their_host_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The ring is not closed, so the thread that keeps it lit goes on."""
    kept: list[Any] = []
    monkeypatch.setattr(LightRing, "close", lambda ring: kept.append(ring))
    try:
        assert Invariant.DARK in broken(suffer(tmp_path, FaultKind.WALL_CLOCK))
    finally:
        monkeypatch.undo()
        for ring in kept:
            ring.close()


def test_a_recording_that_lacks_frames_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = shift.Recording.frames
    monkeypatch.setattr(shift.Recording, "frames", lambda recording: islice(frames(recording), 1, None))
    assert broken(suffer(tmp_path, FaultKind.WALL_CLOCK)) == {Invariant.RECORDING}


def test_handles_that_stay_open_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept: list[Any] = []
    enter = shift.Shift.__enter__

    def leak(opened: shift.Shift) -> shift.Shift:
        kept.append(Path("/dev/null").open())  # noqa: SIM115
        return enter(opened)

    monkeypatch.setattr(shift.Shift, "__enter__", leak)
    monkeypatch.setattr("tests.soak.run.FAULTS_A_SHIFT", 1)
    assert broken(suffer(tmp_path, *[FaultKind.WALL_CLOCK] * 4)) == {Invariant.HANDLES}
    for handle in kept:
        handle.close()
