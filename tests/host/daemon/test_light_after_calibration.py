"""However a calibration ends, camera and LEDs are set as the running bundle says; dark once the daemon is stopped."""

from collections.abc import Callable, Iterator
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import CameraError, InputError
from gellight.bundle.bundle import Bundle
from gellight.bundle.store import BundleStore
from gellight.daemon.calibration_service import CalibrationRequest, CalibrationService
from gellight.daemon.session import SensorSession
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import Camera
from gellight.watch.monitor import SensorWatch
from tests.helpers.linear_sensor import verified_bundle
from tests.helpers.scripted_camera import LitCamera
from tests.helpers.scripted_routine import ScriptedRoutine
from tests.helpers.sessions import session_of
from tests.helpers.waiting import eventually

WHITE = np.full((12, 3), 200, np.uint8)
SENSOR = "E660C06213842F2A"


class LightingRoutine(ScriptedRoutine):
    """Sets exposure, gain and LEDs as a calibration does."""

    def __init__(self, camera: Camera, install: Callable[[Bundle], object]) -> None:
        super().__init__(CalibrationRequest(), install)
        self.camera = camera

    def act(self, action: str, **arguments: float) -> None:
        if action == "start":
            self.camera.controls.set("exposure_us", 20000)
            self.camera.controls.set("gain", 3)
            self.camera.ring.light(WHITE)
        super().act(action, **arguments)


@pytest.fixture
def camera() -> LitCamera:
    return LitCamera()


@pytest.fixture
def running(camera: LitCamera, tmp_path: Path) -> Bundle:
    bundle = verified_bundle(tmp_path / "running", sensor=SENSOR, rgb=(255, 200, 90), exposure_us=9000)
    camera.adopt(bundle.controls, bundle.colours)
    return bundle


@pytest.fixture
def daemon(camera: LitCamera, running: Bundle) -> Iterator[SensorSession]:
    with session_of(camera, Reconstructor(running), watch=SensorWatch(running)) as daemon:
        yield daemon


def served(daemon: SensorSession, folder: Path) -> CalibrationService:
    def make(request: CalibrationRequest, install: Callable[[Bundle], object]) -> LightingRoutine:
        return LightingRoutine(daemon.camera, install)

    return CalibrationService(daemon, store=BundleStore(folder / "store"), folder=folder / "state", make_routine=make)


def finish(service: CalibrationService) -> None:
    service.act("abort")
    service._end.join(10)


def test_the_running_bundle_is_lit_again(daemon: SensorSession, camera: LitCamera, tmp_path: Path) -> None:
    before = camera.setting()
    with served(daemon, tmp_path) as service:
        service.begin(CalibrationRequest())
        assert camera.setting() != before
        assert daemon.watch.paused
        finish(service)
        assert camera.setting() == before, "the gain too, of which the bundle says nothing"
        assert not daemon.watch.paused
        assert daemon.status()["error"] is None


def test_a_routine_that_cannot_start_leaves_nothing_changed(
    daemon: SensorSession, camera: LitCamera, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = camera.setting()

    def refuse(routine: LightingRoutine, action: str) -> None:
        camera.ring.light(WHITE)
        raise InputError("not now")

    monkeypatch.setattr(LightingRoutine, "act", refuse)
    with served(daemon, tmp_path) as service:
        with pytest.raises(InputError, match="not now"):
            service.begin(CalibrationRequest())
        assert camera.setting() == before
        monkeypatch.undo()
        service.begin(CalibrationRequest())


def test_a_stopped_daemon_stays_dark(camera: LitCamera, running: Bundle, tmp_path: Path) -> None:
    with session_of(camera, Reconstructor(running), watch=SensorWatch(running)) as daemon:
        service = served(daemon, tmp_path)
        service.begin(CalibrationRequest())
    finish(service)
    assert camera.closed
    assert not camera.ring.lit.any()
    with pytest.raises(CameraError, match="was stopped: its LEDs stay dark"):
        daemon.replace_bundle(running)


def test_lighting_that_fails_is_shown_and_tried_again(
    daemon: SensorSession, camera: LitCamera, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gellight.daemon.calibration_service.RETRY_S", 0.05)
    monkeypatch.setattr("gellight.daemon.calibration_service.SETTLE_S", 0.05)
    before = camera.setting()
    with served(daemon, tmp_path) as service:
        service.begin(CalibrationRequest())
        camera.failures.reset("light")
        service.act("abort")
        eventually(lambda: daemon.status()["error"])
        assert str(daemon.status()["error"]).startswith("the sensor is not set as its bundle says: light failed")
        with pytest.raises(InputError, match="its status says why"):
            service.begin(CalibrationRequest())
        camera.failures.reset()
        service._end.join(10)
        assert camera.setting() == before
        assert daemon.status()["error"] is None


def test_a_sensor_that_does_not_say_how_it_is_set_can_be_calibrated_later(
    daemon: SensorSession, camera: LitCamera, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served(daemon, tmp_path) as service:
        with monkeypatch.context() as broken:
            broken.setattr(camera.controls, "read", Mock(side_effect=CameraError("gain cannot be read")))
            with pytest.raises(CameraError, match="cannot be read"):
                service.begin(CalibrationRequest())
        service.begin(CalibrationRequest())
        finish(service)
