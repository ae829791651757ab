"""The calibration beside a running sensor: the stream goes on, the watch rests, only what passes is taken over."""

import shutil
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import CameraError, InputError
from gellight.base.mailbox import Mailbox
from gellight.bundle.bundle import Bundle
from gellight.bundle.store import BundleStore
from gellight.daemon.calibration_service import CalibrationRequest as Request
from gellight.daemon.calibration_service import CalibrationService as Service
from gellight.daemon.frame_threads import SharedCamera
from gellight.daemon.session import SensorSession
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import Camera
from gellight.opening import open_camera
from gellight.watch.monitor import SensorWatch
from tests.helpers.begun_calibration import begun_in, identity
from tests.helpers.linear_sensor import linear_bundle, verified_bundle
from tests.helpers.scripted_calibration import snapshot
from tests.helpers.scripted_camera import LitCamera, flat_camera
from tests.helpers.scripted_routine import ScriptedRoutine, served
from tests.helpers.sessions import session_of
from tests.helpers.waiting import eventually

SHAPE = flat_camera().image_shape


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[SensorSession]:
    bundle = linear_bundle(tmp_path / "running", SHAPE)
    with session_of(flat_camera(period_s=0.005), Reconstructor(bundle), watch=SensorWatch(bundle)) as daemon:
        yield daemon


@pytest.fixture
def routines() -> list[ScriptedRoutine]:
    return []


@pytest.fixture
def service(daemon: SensorSession, tmp_path: Path, routines: list[ScriptedRoutine]) -> Iterator[Service]:
    with served(daemon, tmp_path, routines) as service:
        yield service


def test_an_interrupted_calibration_is_offered_with_the_tools_it_was_begun_with(
    service: Service, tmp_path: Path
) -> None:
    assert not service.state().interrupted
    folder = begun_in(tmp_path / "state", identity(ball_mm=2.5, cylinder_mm=6.0))
    assert service.state().interrupted
    defaults = service.state().defaults
    assert (defaults.ball_radius_mm, defaults.cylinder_diameter_mm) == (2.5, 6.0)
    folder.close()
    assert not service.state().interrupted
    assert service.state().defaults.ball_radius_mm == 4.0
    (tmp_path / "state" / "state.json").write_text("{")
    assert service.state().defaults.ball_radius_mm == 4.0


def test_what_a_calibration_needs_is_listed_before_and_not_while_it_goes_on(
    service: Service, daemon: SensorSession, routines: list[ScriptedRoutine], monkeypatch: pytest.MonkeyPatch
) -> None:
    daemon.wait_frame(1, 60)
    listed = {need.name: need for need in service.state().needs}
    assert {name: need.state for name, need in listed.items()} == {
        "ball": "yours", "cylinder": "yours", "gel": "yours", "light": "yours", "camera": "ready", "disk": "ready",
    }  # fmt: skip
    assert listed["disk"].text.endswith("GB free")
    monkeypatch.setattr(shutil, "disk_usage", lambda place: SimpleNamespace(free=1_000))
    full = next(need for need in service.state().needs if need.name == "disk")
    assert full.state == "missing"
    assert "0 MB are free" in full.text
    assert not service.calibrating
    service.begin(Request())
    assert service.calibrating
    assert service.state().needs == ()
    routines[0].over.set()
    assert not service.calibrating


def test_a_bundle_that_passes_is_taken_over_by_the_stream_and_can_be_taken_back(
    service: Service, daemon: SensorSession, routines: list[ScriptedRoutine], tmp_path: Path
) -> None:
    service.begin(Request(presses=12))
    assert routines[0].request.presses == 12
    assert routines[0].acts == [("start", {})]
    before = daemon.wait_frame(0, 60).camera_frame.sequence
    first, second = (verified_bundle(tmp_path / name, sensor=service.sensor) for name in ("first", "second"))
    for one in (first, second):
        routines[0].install(one)
        assert daemon.bundle.identity == service.state().in_service == one.identity
    assert daemon.wait_frame(before + 1, 60).camera_frame.sequence > before
    assert daemon.watch.paused, "the new bundle's watch rests too as long as the calibration goes on"
    routines[0].over.set()
    service.restore(first.identity)
    assert daemon.bundle.identity == first.identity
    assert [entry.in_service for entry in service.state().bundles].count(True) == 1


def test_the_watch_rests_while_a_calibration_goes_on(
    service: Service, daemon: SensorSession, routines: list[ScriptedRoutine]
) -> None:
    service.begin(Request())
    assert daemon.watch.paused
    for refused in (lambda: service.begin(Request()), lambda: service.restore("")):
        with pytest.raises(InputError, match="a calibration is going on: stop it"):
            refused()
    service.act("abort")
    service._end.join(60)
    assert not daemon.watch.paused
    assert service.state().routine == {"step": "finished"}


def test_leaving_the_service_stops_what_goes_on(daemon: SensorSession, tmp_path: Path) -> None:
    routine = ScriptedRoutine(Request(), lambda _: None)
    with Service(
        daemon, store=BundleStore(tmp_path), folder=tmp_path / "x", make_routine=lambda *_: routine
    ) as service:
        service.begin(Request())
    assert routine.acts[-1] == ("abort", {})


def test_what_is_not_there_is_told_and_no_other_programs_folder_is_removed(service: Service, tmp_path: Path) -> None:
    assert service.picture("live").shape == (*SHAPE, 3)
    with pytest.raises(InputError, match="no picture 'press' yet"):
        service.picture("press")
    with pytest.raises(InputError, match="no calibration is going on: begin one"):
        service.act("next")
    (tmp_path / "state").mkdir()
    (tmp_path / "state/state.json").write_text("{}")
    with pytest.raises(InputError, match="is not the state of a calibration"):
        service.begin(Request(anew=True))
    assert (tmp_path / "state/state.json").read_text() == "{}"


def test_a_sensor_that_cannot_be_calibrated_now_costs_no_interrupted_calibration(
    service: Service, daemon: SensorSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun_in(tmp_path / "state")
    monkeypatch.setattr(daemon, "begin_calibration", Mock(side_effect=CameraError("no ring")))
    with pytest.raises(CameraError):
        service.begin(Request(anew=True))
    assert service.state().interrupted
    assert not service.calibrating


def test_a_shared_camera_gives_only_what_was_exposed_after_it_was_asked() -> None:
    camera = flat_camera()
    captured: Mailbox[Any] = Mailbox()
    shared = SharedCamera(camera, captured)
    captured.put(camera.read())

    def later() -> None:
        captured.put(camera.read())

    timer = threading.Timer(0.05, later)
    timer.start()
    assert shared.read().sequence == 2, "the first was there before anybody asked"
    captured.close(CameraError("unplugged"))
    with pytest.raises(CameraError, match="unplugged"):
        shared.read()


def test_the_routine_itself_runs_beside_the_stream_and_is_stopped(tmp_path: Path) -> None:
    small = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 4 * 0.0588}
    camera = open_camera("sim://?board=0&fps=100", geometry=small)
    running = linear_bundle(tmp_path / "running", (120, 160))
    with (
        session_of(camera, Reconstructor(running), watch=SensorWatch(running)) as daemon,
        Service(daemon, store=BundleStore(tmp_path / "store"), folder=tmp_path / "state") as service,
    ):
        sequence = daemon.wait_frame(0, 60).camera_frame.sequence
        service.begin(Request(hand=True, presses=8))
        eventually(lambda: "prepare" in service.state().routine["figures"], 120)
        routine = service.state().routine
        assert routine["step"] in ("prepare", "reference"), routine["problem"]
        assert set(snapshot("presses")) <= set(routine), "the page's tests know what the routine says"
        assert daemon.wait_frame(sequence, 60).camera_frame.sequence > sequence
        service.act("abort")
        eventually(lambda: service.state().routine["step"] == "aborted", 120)
        assert service.state().interrupted
        assert daemon.bundle.identity == running.identity


# ---- camera and LEDs are set as the running bundle says, however it ends ----


WHITE = np.full((12, 3), 200, np.uint8)
SENSOR = "E660C06213842F2A"


class LightingRoutine(ScriptedRoutine):
    """Sets exposure, gain and LEDs as a calibration does."""

    def __init__(self, camera: Camera, install: Callable[[Bundle], object]) -> None:
        super().__init__(Request(), install)
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
def lit(camera: LitCamera, running: Bundle) -> Iterator[SensorSession]:
    with session_of(camera, Reconstructor(running), watch=SensorWatch(running)) as lit:
        yield lit


def lighting(daemon: SensorSession, folder: Path) -> Service:
    def make(request: Request, install: Callable[[Bundle], object]) -> LightingRoutine:
        return LightingRoutine(daemon.camera, install)

    return Service(daemon, store=BundleStore(folder / "store"), folder=folder / "state", make_routine=make)


def finish(service: Service) -> None:
    service.act("abort")
    service._end.join(60)


def test_a_routine_that_cannot_start_leaves_nothing_changed(
    lit: SensorSession, camera: LitCamera, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = camera.setting()

    def refuse(routine: LightingRoutine, action: str) -> None:
        camera.ring.light(WHITE)
        raise InputError("not now")

    monkeypatch.setattr(LightingRoutine, "act", refuse)
    with lighting(lit, tmp_path) as service:
        with pytest.raises(InputError, match="not now"):
            service.begin(Request())
        assert camera.setting() == before
        monkeypatch.undo()
        service.begin(Request())


def test_a_stopped_daemon_stays_dark(camera: LitCamera, running: Bundle, tmp_path: Path) -> None:
    with session_of(camera, Reconstructor(running), watch=SensorWatch(running)) as lit:
        service = lighting(lit, tmp_path)
        service.begin(Request())
    finish(service)
    assert camera.closed
    assert not camera.ring.lit.any()
    with pytest.raises(CameraError, match="was stopped: its LEDs stay dark"):
        lit.replace_bundle(running)


def test_lighting_that_fails_is_shown_and_tried_again(
    lit: SensorSession, camera: LitCamera, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gellight.daemon.calibration_service.RETRY_S", 0.05)
    monkeypatch.setattr("gellight.daemon.calibration_service.SETTLE_S", 0.05)
    before = camera.setting()
    with lighting(lit, tmp_path) as service:
        service.begin(Request())
        camera.failures.reset("light")
        service.act("abort")
        eventually(lambda: lit.status()["error"])
        assert str(lit.status()["error"]).startswith("the sensor is not set as its bundle says: light failed")
        with pytest.raises(InputError, match="its status says why"):
            service.begin(Request())
        camera.failures.reset()
        service._end.join(60)
        assert camera.setting() == before
        assert lit.status()["error"] is None


def test_a_sensor_that_does_not_say_how_it_is_set_can_be_calibrated_later(
    lit: SensorSession, camera: LitCamera, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with lighting(lit, tmp_path) as service:
        with monkeypatch.context() as broken:
            broken.setattr(camera.controls, "read", Mock(side_effect=CameraError("gain cannot be read")))
            with pytest.raises(CameraError, match="cannot be read"):
                service.begin(Request())
        service.begin(Request())
        finish(service)
