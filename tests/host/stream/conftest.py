"""Daemons of a test are found by that test alone; a recording that several tests read."""

from pathlib import Path

import pytest

import gellight
from gellight.recording.kinds import DepthKind
from gellight.stream.recorder import Recorder
from gellight.stream.sensor import Sensor
from tests.helpers.waiting import eventually


@pytest.fixture(autouse=True)
def own_runtime_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who says nothing else waits two minutes for a frame: processors are shared."""
    for waits in (gellight.connect, gellight.subscribe, Sensor.__init__):
        monkeypatch.setitem(waits.__kwdefaults__, "patience_s", 120.0)


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A few frames of a ball in a simulated sensor, with the depth of at least three of them."""
    path = tmp_path_factory.mktemp("recorded") / "ball.mcap"
    with gellight.connect("sim://?object=BALL&depth=1&fps=2", patience_s=120) as sensor:
        sensor.next_frame()
        with Recorder(sensor.daemon, path, depth=DepthKind.FLOAT32) as recorder:
            assert sensor.daemon.status()["recording"] == path.name
            eventually(lambda: recorder.status.frames >= 6 and recorder.status.depths >= 3, 120)
        assert sensor.daemon.status()["recording"] is None
    return path
