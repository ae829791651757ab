"""Some minutes of faults, and that the soak notices a product that does not stand them: each weakness is planted."""

import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from gellight.ring.light_ring import LightRing
from gellight.sensor.sensor_camera import SensorCamera
from tests.helpers import children
from tests.helpers.places import CHECKOUT
from tests.soak import shift
from tests.soak.faults import FaultKind, PlannedFault
from tests.soak.judging import RECOVERY_S, Invariant
from tests.soak.run import Report, Soak
from tests.soak.shift import Shift

SEED = 2026
HOURS = 0.3
pytestmark = [pytest.mark.nightly, pytest.mark.timeout(600)]


@pytest.fixture(autouse=True)
def home(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with tempfile.TemporaryDirectory() as folder:
        monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
        yield


def suffer(tmp_path: Path, *kinds: FaultKind, seconds: float = 1.0, works: bool = False) -> Report:
    faults = [PlannedFault(60.0 * number, kind, seconds, 1.0) for number, kind in enumerate(kinds)]
    return Soak(0, tmp_path, print, works=works).run(iter(faults))


def broken(report: Report) -> set[Invariant]:
    return {violation.invariant for violation in report.violations}


def program(*arguments: str) -> subprocess.CompletedProcess[str]:
    """In a process of its own: what other tests left in memory is not judged."""
    return children.run([sys.executable, "-m", "tests.soak", *arguments], cwd=CHECKOUT, timeout_s=500)


def test_everything_holds_under_faults_drawn_at_random() -> None:
    ended = program("--hours", str(HOURS), "--faults", str(SEED), "--json")
    report = json.loads(ended.stdout)
    assert report["violations"] == [], ended.stderr
    assert report["not_judged"] == []
    assert ended.returncode == 0
    assert report["labels"] > 0
    assert set(report["faults"]) == set(FaultKind), "every kind of fault was made"
    assert report["frames"] > 200, "three a second come while the sensor is calibrated"


def test_what_was_not_judged_did_not_hold() -> None:
    ended = program("--hours", "0.01", "--faults", "11")
    assert ended.returncode == 1, ended.stderr
    assert "not judged: memory bounded\n" in ended.stdout
    assert "everything held" not in ended.stdout


def test_a_slow_recovery_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It comes when nobody waits any more: a starved process is granted time, and so might be a recovery of seconds."""
    find, recover, given_up = SensorCamera._return, Soak._recover, threading.Event()

    def slow(camera: SensorCamera) -> None:
        given_up.wait(120.0)
        find(camera)

    def watched(soak: Soak, kind: FaultKind | None, shift: Shift) -> float:
        taken_s = recover(soak, kind, shift)
        if kind is not None:
            given_up.set()
        return taken_s

    monkeypatch.setattr(SensorCamera, "_return", slow)
    monkeypatch.setattr(Soak, "_recover", watched)
    monkeypatch.setattr("tests.soak.run.GIVE_UP_S", 2 * RECOVERY_S)
    assert broken(suffer(tmp_path, FaultKind.UNPLUGGED)) == {Invariant.RECOVERY}


def test_leds_that_shine_on_without_their_host_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The ring is not closed, so the thread that keeps it lit goes on; on a busy machine it may once come too late."""
    kept: list[Any] = []
    monkeypatch.setattr(LightRing, "close", lambda ring: kept.append(ring))
    try:
        tries = (broken(suffer(tmp_path / str(number), FaultKind.WALL_CLOCK)) for number in range(3))
        assert any(Invariant.DARK in found for found in tries)
    finally:
        monkeypatch.undo()
        for ring in kept:
            ring.close()


def test_a_recording_that_lacks_frames_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = shift.Recording.frames
    monkeypatch.setattr(shift.Recording, "frames", lambda recording: islice(frames(recording), 1, None))
    assert broken(suffer(tmp_path, FaultKind.WALL_CLOCK)) == {Invariant.RECORDING}
