"""The daemon: always the newest frame, no error swallowed, everything closed."""

import threading
import time
from pathlib import Path
from typing import Any

import pytest

from gellight.base.errors import BundleError, CameraError
from gellight.daemon.daemon import Daemon
from gellight.frames.camera import EndOfStream
from gellight.reconstruction.pipeline import Reconstructor
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.scripted_camera import CountingReconstructor, FlatCamera, ScriptedCamera


def daemon_of(camera: ScriptedCamera, reconstructor: CountingReconstructor | None = None) -> Daemon:
    parts: Any = camera, reconstructor or CountingReconstructor()
    return Daemon(*parts)


def follow(daemon: Daemon, seen: list[int]) -> None:
    """Note the sequence number of every frame, until the end is raised."""
    while True:
        seen.append(daemon.wait_frame(seen[-1] if seen else 0, 10).camera_frame.sequence)


def test_frames_come_in_order_and_the_end_is_told_after_the_last() -> None:
    camera = ScriptedCamera(20, EndOfStream("used up"), period_s=0.02)
    seen: list[int] = []
    with daemon_of(camera) as daemon, pytest.raises(EndOfStream, match="used up"):
        follow(daemon, seen)
    assert seen == sorted(set(seen))
    assert seen[-1] == 20, "the newest frame before the end is delivered"
    assert camera.closed


def test_a_slow_reconstruction_drops_the_old_and_takes_the_newest() -> None:
    camera = ScriptedCamera(50, EndOfStream("used up"))
    reconstructor = CountingReconstructor()
    reconstructor.gate.clear()
    with daemon_of(camera, reconstructor) as daemon:
        while camera.sequence < 50:
            time.sleep(0.001)
        reconstructor.gate.set()
        newest = daemon.wait_frame(1, 10)
        assert newest.camera_frame.sequence == 50
        status = daemon.status()
    assert status["dropped"] == 50 - status["frames"]
    assert status["dropped"] >= 48


def test_a_camera_that_fails_ends_the_run_with_its_own_words() -> None:
    camera = ScriptedCamera(1, CameraError("the cable is out: plug it in"))
    with daemon_of(camera) as daemon:
        with pytest.raises(CameraError, match="cable is out"):
            daemon.wait_frame(1, 10)
        assert daemon.status()["error"] == "the cable is out: plug it in"
    assert camera.closed


def test_a_reconstruction_that_fails_ends_the_run_too() -> None:
    reconstructor = CountingReconstructor()
    reconstructor.failure = ValueError("broken network")
    with daemon_of(ScriptedCamera(10**9, CameraError("never"), period_s=0.001), reconstructor) as daemon:
        with pytest.raises(ValueError, match="broken network"):
            daemon.wait_frame(0, 10)
        assert daemon.status()["error"] == "broken network"


def test_waiting_has_an_end() -> None:
    reconstructor = CountingReconstructor()
    reconstructor.gate.clear()
    with daemon_of(ScriptedCamera(10**9, CameraError("never"), period_s=0.001), reconstructor) as daemon:
        with pytest.raises(TimeoutError):
            daemon.wait_frame(0, 0.05)
        reconstructor.gate.set()


def test_after_the_end_nobody_waits_and_no_thread_is_left() -> None:
    before = threading.active_count()
    daemon = daemon_of(ScriptedCamera(10**9, CameraError("never"), period_s=0.001))
    with daemon:
        sequence = daemon.wait_frame(0, 10).camera_frame.sequence
    assert threading.active_count() == before
    with pytest.raises(CameraError, match="stopped"):
        daemon.wait_frame(sequence + 10**6, 10)
    assert daemon.pixel_size_mm == (0.1, 0.2)


def test_a_running_daemon_takes_another_calibration_between_two_frames(tmp_path: Path) -> None:
    first = linear_bundle(tmp_path / "first", (24, 32))
    second = linear_bundle(tmp_path / "second", (24, 32), pixel_size_mm=(0.07, 0.08))
    camera: Any = FlatCamera(10**9, CameraError("never"), period_s=0.002)
    with Daemon(camera, Reconstructor(first)) as daemon:
        before = daemon.wait_frame(0, 10).camera_frame.sequence
        daemon.replace_bundle(second)
        assert daemon.wait_frame(before, 10).camera_frame.sequence > before, "the stream went on"
        assert (daemon.bundle.identity, daemon.pixel_size_mm) == (second.identity, (0.07, 0.08))
        with pytest.raises(BundleError, match=r"32x24 pixels.*is for 64x48"):
            daemon.replace_bundle(linear_bundle(tmp_path / "large", (48, 64)))
        broken = linear_bundle(tmp_path / "broken", (24, 32), network=b"no network")
        with pytest.raises(BundleError, match="cannot be loaded"):
            daemon.replace_bundle(broken)
        assert daemon.bundle.identity == second.identity
        assert daemon.status()["error"] is None
