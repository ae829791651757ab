"""The calibration beside a running sensor: the stream goes on, the watch rests, only what passes is taken over."""

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from gellight.base.errors import BundleError, CameraError, GellightError, InputError
from gellight.base.mailbox import Mailbox
from gellight.base.settings import load_settings
from gellight.bundle.store import BundleStore
from gellight.daemon.assembly import open_session
from gellight.daemon.calibration_service import CalibrationRequest as Request
from gellight.daemon.calibration_service import CalibrationService as Service
from gellight.daemon.frame_threads import SharedCamera
from gellight.daemon.session import SensorSession
from gellight.frame_path.pipeline import Reconstructor
from gellight.opening import open_camera
from gellight.watch.monitor import SensorWatch
from tests.helpers.begun_calibration import begun_in, identity
from tests.helpers.linear_sensor import linear_bundle, verified_bundle
from tests.helpers.scripted_calibration import snapshot
from tests.helpers.scripted_camera import flat_camera
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
    folder = begun_in(tmp_path / "state", identity(ball_mm=2.5, cylinder_mm=6.0, pins_mm=2.0))
    assert service.state().interrupted
    defaults = service.state().defaults
    tools = [getattr(defaults, name) for name in ("ball_radius_mm", "cylinder_diameter_mm", "pin_pitch_mm")]
    assert tools == [2.5, 6.0, 2.0]
    folder.close()
    assert not service.state().interrupted
    assert service.state().defaults.ball_radius_mm == 4.0
    (tmp_path / "state" / "state.json").write_text("{")
    assert service.state().defaults.ball_radius_mm == 4.0


def test_what_a_calibration_needs_is_listed_before_and_not_while_it_goes_on(
    service: Service, daemon: SensorSession, routines: list[ScriptedRoutine], monkeypatch: pytest.MonkeyPatch
) -> None:
    daemon.wait_frame(1, 10)
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
    before = daemon.wait_frame(0, 10).camera_frame.sequence
    first, second = (verified_bundle(tmp_path / name, sensor=service.sensor) for name in ("first", "second"))
    for one in (first, second):
        routines[0].install(one)
        assert daemon.bundle.identity == service.state().in_service == one.identity
    assert daemon.wait_frame(before + 1, 10).camera_frame.sequence > before
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
    service._end.join(10)
    assert not daemon.watch.paused
    assert service.state().routine == {"step": "finished"}


def test_leaving_the_service_stops_what_goes_on(daemon: SensorSession, tmp_path: Path) -> None:
    routine = ScriptedRoutine(Request(), lambda _: None)
    with Service(
        daemon, store=BundleStore(tmp_path), folder=tmp_path / "x", make_routine=lambda *_: routine
    ) as service:
        service.begin(Request())
    assert routine.acts[-1] == ("abort", {})


def test_pictures_and_actions_that_are_not_there_are_told(service: Service) -> None:
    assert service.picture("live").shape == (*SHAPE, 3)
    with pytest.raises(InputError, match="no picture 'press' yet"):
        service.picture("press")
    with pytest.raises(InputError, match="no calibration is going on: begin one"):
        service.act("next")


def test_an_interrupted_calibration_is_offered_and_forgotten_only_when_asked(service: Service, tmp_path: Path) -> None:
    begun_in(tmp_path / "state")
    assert service.state().interrupted
    service.begin(Request())
    assert service.state().interrupted
    service.act("abort")
    service.begin(Request(anew=True))
    assert not service.state().interrupted


def test_what_is_no_like_unit_is_told_and_costs_no_interrupted_calibration(service: Service, tmp_path: Path) -> None:
    begun_in(tmp_path / "state")
    bare = BundleStore(tmp_path / "store").add(linear_bundle(tmp_path / "bare", SHAPE))
    for wrong, told in (("0" * 16, "no bundle"), (bare.identity, r"has no presses\.npz")):
        with pytest.raises(BundleError, match=told):
            service.begin(Request(like=wrong, anew=True))
    assert service.state().interrupted
    assert not service.calibrating


@pytest.mark.parametrize(("wrong", "told"), [({"presses": 3}, "at least 8 are needed"), ({"away": True}, "no ring")])
def test_a_request_that_cannot_be_met_costs_no_interrupted_calibration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: dict[str, int], told: str
) -> None:
    folder = begun_in(tmp_path / "state")
    with (
        open_session(load_settings({"sensor.url": "sim://?programme=0"})) as sensor,
        Service(sensor, store=BundleStore(tmp_path / "store"), folder=folder.path) as real,
    ):
        sensor.wait_frame(-1, 30)
        if wrong.pop("away", False):
            monkeypatch.setattr(sensor, "begin_calibration", Mock(side_effect=CameraError("no ring")))
        with pytest.raises(GellightError, match=told):
            real.begin(Request(anew=True, **wrong))
        assert real.state().interrupted
        assert not real.calibrating


def test_beginning_anew_removes_no_folder_of_another_program(service: Service, tmp_path: Path) -> None:
    (tmp_path / "state").mkdir()
    (tmp_path / "state/state.json").write_text("{}")
    with pytest.raises(InputError, match="is not the state of a calibration"):
        service.begin(Request(anew=True))
    assert (tmp_path / "state/state.json").read_text() == "{}"


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
        sequence = daemon.wait_frame(0, 20).camera_frame.sequence
        service.begin(Request(hand=True, presses=8))
        eventually(lambda: "prepare" in service.state().routine["figures"], 120)
        routine = service.state().routine
        assert routine["step"] in ("prepare", "reference"), routine["problem"]
        assert set(snapshot("presses")) <= set(routine), "the page's tests know what the routine says"
        assert daemon.wait_frame(sequence, 20).camera_frame.sequence > sequence
        service.act("abort")
        eventually(lambda: service.state().routine["step"] == "aborted", 120)
        assert service.state().interrupted
        assert daemon.bundle.identity == running.identity
