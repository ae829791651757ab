"""The daemon: always the newest frame, no error swallowed, everything closed."""

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import BundleError, CameraError, InputError
from gellight.daemon.bundle_choice import placeholder
from gellight.daemon.frame_threads import FrameThreads
from gellight.daemon.session import SensorSession
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.watch.findings import WatchFinding
from gellight.watch.monitor import Zero
from tests.helpers.linear_sensor import linear_bundle, reference_image
from tests.helpers.scripted_camera import CountingReconstructor, ScriptedCamera, flat_camera
from tests.helpers.scripted_ring import ScriptedRing
from tests.helpers.sessions import session_of
from tests.helpers.waiting import eventually


def daemon_of(camera: ScriptedCamera, reconstructor: CountingReconstructor | None = None) -> SensorSession:
    return session_of(camera, reconstructor or CountingReconstructor())


def follow(daemon: SensorSession, seen: list[int]) -> None:
    """Note the sequence number of every frame, until the end is raised."""
    while True:
        seen.append(daemon.wait_frame(seen[-1] if seen else 0, 60).camera_frame.sequence)


def read_on(camera: Camera) -> None:
    """Read until the end is raised."""
    while True:
        camera.read()


def test_frames_come_in_order_and_the_end_is_told_after_the_last() -> None:
    camera = ScriptedCamera(count=20, period_s=0.02)
    seen: list[int] = []
    with daemon_of(camera) as daemon, pytest.raises(EndOfStream, match="used up"):
        follow(daemon, seen)
    assert seen == sorted(set(seen))
    assert seen[-1] == 20, "the newest frame before the end is delivered"
    assert camera.closed


def test_a_frame_that_is_being_read_when_the_light_changes_is_not_delivered() -> None:
    reading, gate = threading.Event(), threading.Event()

    def exposed(number: int) -> np.ndarray:
        reading.set()
        assert gate.wait(60)
        return np.zeros((2, 2, 3), np.uint8)

    camera, network = ScriptedCamera(exposed, period_s=0.01, ring=ScriptedRing()), CountingReconstructor()
    network.status = lambda: {"mode": "network"}  # type: ignore[method-assign]
    with daemon_of(camera, network) as daemon:
        assert reading.wait(60)
        changing = threading.Thread(target=daemon.light, args=(np.zeros((12, 3), np.uint8),))
        changing.start()
        gate.set()
        changing.join(60)
        assert daemon.wait_frame(0, 60).camera_frame.sequence > 1


def test_a_frame_that_is_being_reconstructed_when_all_before_is_flushed_is_not_delivered() -> None:
    second, begun = threading.Event(), threading.Event()
    slow = CountingReconstructor()
    slow.gate.clear()

    def picture(number: int) -> np.ndarray:
        assert number == 1 or second.wait(60)
        return np.zeros((2, 2, 3), np.uint8)

    def reconstruct(frame: CameraFrame) -> TactileFrame:
        begun.set()
        return slow.reconstruct(frame)

    threads = FrameThreads(ScriptedCamera(picture), reconstruct, lambda: placeholder((2, 2)))
    threads.start()
    assert begun.wait(60)
    threads.flush()  # the frame in hand is the newest of all
    slow.gate.set()
    with pytest.raises(TimeoutError):
        threads.delivered.take(0, 0.3)
    second.set()
    assert threads.delivered.take(0, 60)[1].camera_frame.sequence > 1
    threads.stop()


def test_the_pictures_of_files_wait_for_their_reader() -> None:
    camera = ScriptedCamera(count=30)
    camera.waits = True
    seen: list[int] = []
    with session_of(camera, CountingReconstructor(), every=True) as daemon:
        for _ in range(30):
            daemon.wait_frame(-1, 60)  # somebody else, such as the page, looks at the newest
            seen.append(daemon.next_frame(seen[-1] if seen else 0, 60).camera_frame.sequence)
            time.sleep(0.002)
        with pytest.raises(EndOfStream, match="used up"):
            daemon.next_frame(30, 60)
    assert seen == list(range(1, 31))


def test_a_slow_reconstruction_drops_the_old_and_takes_the_newest() -> None:
    camera = ScriptedCamera(count=50)
    reconstructor = CountingReconstructor()
    reconstructor.gate.clear()
    with daemon_of(camera, reconstructor) as daemon:
        eventually(lambda: camera.sequence >= 50)
        reconstructor.gate.set()
        newest = daemon.wait_frame(1, 60)
        assert newest.camera_frame.sequence == 50
        status = daemon.status()
    assert status["dropped"] == 50 - status["frames"]
    assert status["dropped"] >= 48


@pytest.mark.parametrize("fails", ["camera", "reconstruction"])
def test_what_fails_ends_the_run_with_its_own_words_for_every_reader_at_once(fails: str) -> None:
    camera, network = ScriptedCamera(period_s=0.001), CountingReconstructor()
    if fails == "camera":
        camera.count, camera.ending = 1, CameraError("the cable is out: plug it in")
    else:
        network.failure = CameraError("the cable is out: plug it in")
    with daemon_of(camera, network) as daemon:
        with pytest.raises(CameraError, match="cable is out"):
            daemon.wait_frame(1, 60)
        with pytest.raises(CameraError, match="cable is out"):
            read_on(daemon.camera)
        assert daemon.status()["error"] == "the cable is out: plug it in"
    assert camera.closed


def test_after_the_end_nobody_waits_and_no_thread_is_left() -> None:
    before = threading.active_count()
    daemon = daemon_of(ScriptedCamera(period_s=0.001))
    with daemon:
        shared = daemon.camera
        shared.read()
        sequence = daemon.wait_frame(0, 60).camera_frame.sequence
    assert threading.active_count() == before
    for ask in (lambda: daemon.wait_frame(sequence + 10**6, 60), lambda: read_on(shared)):
        with pytest.raises(CameraError, match="stopped"):
            ask()
    assert daemon.pixel_size_mm == (0.1, 0.2)


def test_the_status_says_what_fresh_presses_have_shown_of_the_bundle(tmp_path: Path) -> None:
    bundle = linear_bundle(tmp_path / "bundle", (24, 32))
    with session_of(flat_camera(), Reconstructor(bundle)) as daemon:
        assert daemon.status()["calibration"] == {
            "sensor": bundle.manifest.sensor, "identity": bundle.identity, "verified": None, "force": None,
        }  # fmt: skip
        bundle.metrics["verification"] = {"presses": 6, "depth_mm": 0.003, "normal_deg": 0.2}
        assert daemon.status()["calibration"]["verified"] == {"presses": 6, "depth_mm": 0.003, "normal_deg": 0.2}


class ScriptedWatch:
    """A watch that does as a test says."""

    def __init__(self) -> None:
        self.paused, self.rezero = False, True
        self.looks = self.zeros = 0
        self.failing = False
        self.worth = threading.Event()
        """whether a zero is worth setting"""
        self.asking = threading.Event()
        self.answer = threading.Event()

    def note(self, frame: TactileFrame) -> None:
        self.looks += 1
        if self.failing:
            raise BundleError("the network answered with NaN")

    def findings(self) -> list[WatchFinding]:
        return []

    def refusal(self, *, asked: bool) -> str:
        if not self.worth.is_set():
            return "the zero is right"
        if not asked:
            self.asking.set()
            self.answer.wait(60)
        return ""

    def propose_zero(self, *, asked: bool) -> Zero:
        if not self.worth.is_set():
            raise InputError("the zero was not set: the zero is right")
        return Zero(cells=np.zeros((3, 4, 3), np.float32), reference=reference_image((24, 32)), time_s=0.0)

    def accept_zero(self, zero: Zero) -> None:
        self.zeros += 1
        self.worth.clear()

    def status(self) -> dict[str, object]:
        return {}

    def wait_looks(self, more: int) -> None:
        wanted = self.looks + more
        eventually(lambda: self.looks >= wanted)


@pytest.fixture
def watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[SensorSession, ScriptedWatch]]:
    monkeypatch.setattr("gellight.daemon.session.PERIOD_S", 0.01)
    camera, watch = flat_camera(), ScriptedWatch()
    path = Reconstructor(linear_bundle(tmp_path / "running", (24, 32)))
    with session_of(camera, path, watch=watch) as daemon:
        watch.wait_looks(1)
        yield daemon, watch


def test_a_zero_that_is_set_between_two_questions_of_the_watch_is_no_error(
    watched: tuple[SensorSession, ScriptedWatch],
) -> None:
    daemon, watch = watched
    watch.worth.set()
    assert watch.asking.wait(60)
    refusals: list[InputError] = []

    def set_zero() -> None:
        try:
            daemon.rezero()
        except InputError as error:
            refusals.append(error)

    person = threading.Thread(target=set_zero)
    person.start()
    person.join(0.2)
    watch.answer.set()
    person.join(60)
    watch.wait_looks(3)
    assert daemon.status()["error"] is None
    assert (watch.zeros, len(refusals)) == (1, 1), "one of the two set the zero"


def test_a_bundle_that_is_replaced_between_two_questions_of_the_watch_is_no_error(
    watched: tuple[SensorSession, ScriptedWatch], tmp_path: Path
) -> None:
    daemon, watch = watched
    watch.worth.set()
    assert watch.asking.wait(60)
    second = linear_bundle(tmp_path / "second", (24, 32), pixel_size_mm=(0.07, 0.08))
    replacing = threading.Thread(target=daemon.replace_bundle, args=(second,))
    replacing.start()
    replacing.join(0.5)
    watch.answer.set()
    replacing.join(60)
    eventually(lambda: daemon.status()["watch"].get("looks", 0) >= 3)  # type: ignore[attr-defined]
    assert daemon.bundle.identity == second.identity
    assert daemon.status()["error"] is None


def test_an_error_of_the_watch_that_passed_leaves_the_status(watched: tuple[SensorSession, ScriptedWatch]) -> None:
    daemon, watch = watched
    watch.failing = True
    watch.wait_looks(3)
    assert daemon.status()["error"] == "the network answered with NaN"
    watch.failing = False
    watch.wait_looks(2)
    assert daemon.status()["error"] is None


@pytest.mark.parametrize("fails", ["join", "start"])
def test_a_camera_is_closed_whatever_keeps_its_threads_from_ending_or_starting(
    fails: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Ctrl-C for the second time does, and a computer that has no memory for another thread."""
    camera, usual, calls = ScriptedCamera(period_s=0.001), getattr(threading.Thread, fails), []

    def second(thread: threading.Thread, *arguments: Any) -> None:
        calls.append(thread)
        if len(calls) == 2:
            raise KeyboardInterrupt
        usual(thread, *arguments)

    monkeypatch.setattr(threading.Thread, fails, second)
    with pytest.raises(KeyboardInterrupt), daemon_of(camera) as daemon:
        daemon.wait_frame(0, 60)
    assert camera.closed
    assert not {"capture", "reconstruct"} & {thread.name for thread in threading.enumerate()}


def test_camera_and_reconstruction_run_first_if_asked_where_the_system_lets_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: list[tuple[int, int, int]] = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda thread, policy, param: given.append((thread, policy, param.sched_priority))
    )
    with session_of(ScriptedCamera(period_s=0.01), CountingReconstructor(), realtime=True) as daemon:
        daemon.wait_frame(0, 60)
        running = {thread.name: thread.native_id for thread in threading.enumerate()}
        assert daemon.status()["priority"] == "real time"
    assert given == [(running[name], os.SCHED_FIFO, 10) for name in ("capture", "reconstruct")]
    monkeypatch.setattr(os, "sched_setscheduler", Mock(side_effect=PermissionError(1, "Operation not permitted")))
    camera = ScriptedCamera(period_s=0.01)
    with pytest.raises(InputError, match=r"- rtprio 10` to /etc/security/limits.conf.*leave service.realtime out"):
        session_of(camera, CountingReconstructor(), realtime=True).__enter__()
    assert camera.closed
