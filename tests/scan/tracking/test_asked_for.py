"""The three ways to ask for the pose of the object, with the distribution that tracks and without it."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gellight.base import beside
from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.daemon.assembly import open_session
from gellight.daemon.session import SensorSession
from gellight.frames.frames import TactileFrame
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from tests.helpers.command_line import invoke, refused

HELD = "sim://?board=0&object=CCONVEX&depth=0.8"
REMEDY = 'tracking comes with gellight_scan, which is not installed: pip install "gellight[scan]", or ./host'


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """GelLight without what stands beside it."""
    monkeypatch.setattr(beside, "entry_points", lambda **_: ())


@pytest.fixture
def running(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SensorSession]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with open_session(load_settings({"sensor.url": HELD})) as daemon:
        yield daemon


def frame_taken_from_now_on(daemon: SensorSession) -> TactileFrame:
    asked_s = time.monotonic()
    frame = daemon.wait_frame(-1, 60)
    while frame.camera_frame.time_s < asked_s:
        frame = daemon.wait_frame(frame.camera_frame.sequence, 60)
    return frame


def test_by_the_setting() -> None:
    with open_session(load_settings({"sensor.url": HELD, "tracking.enabled": True})) as daemon:
        assert daemon.status()["tracking"]
        pose = daemon.wait_frame(-1, 60).pose
        assert pose is not None
        assert pose.number == 1


@pytest.mark.usefixtures("alone")
def test_by_the_setting_alone() -> None:
    said = refused(invoke("run", "--sensor", HELD, "--set", "tracking.enabled=true", "--frames", 1))
    assert said.startswith(REMEDY)
    assert "\n" not in said


def test_by_the_command(running: SensorSession) -> None:
    with Publisher(running, name="tracked") as publisher, subscribe(publisher.name, patience_s=60) as frames:
        assert frames.next_frame().pose is None
        frames.track(True)
        first = frame_taken_from_now_on(running)
        frames.track(True)
        on = frame_taken_from_now_on(running)
        assert first.pose is not None
        assert on.pose is not None
        assert on.pose.since_sequence == first.pose.since_sequence, "it goes on"
        frames.track(False)
        assert frame_taken_from_now_on(running).pose is None
        frames.track(True)
        anew = frame_taken_from_now_on(running).pose
        assert anew is not None
        assert (anew.number, anew.since_sequence > on.pose.since_sequence) == (1, True)


@pytest.mark.usefixtures("alone")
def test_by_the_command_alone(running: SensorSession) -> None:
    with Publisher(running, name="untracked") as publisher, subscribe(publisher.name, patience_s=60) as frames:
        with pytest.raises(InputError) as refusal:
            frames.track(True)
        assert str(refusal.value).startswith(REMEDY)
        frames.track(False)
        assert not frames.status()["tracking"]
        assert frame_taken_from_now_on(running).pose is None


@pytest.mark.usefixtures("alone")
def test_by_the_verb_alone(tmp_path: Path) -> None:
    """With it: test_exported.py."""
    file = tmp_path / "recording.mcap"
    file.touch()
    said = refused(invoke("export", file, "--out", tmp_path / "out", "--as", "hdf5", "--track"))
    assert said.startswith(REMEDY)
    assert not (tmp_path / "out").exists()
