"""How readers on the same computer get frames: through shared memory, or over the network where there is none."""

import errno
import gc
import os
import weakref
from pathlib import Path

import numpy as np
import pytest

from gellight.stream import subscription
from gellight.stream.publisher import Publisher
from gellight.stream.running import running
from gellight.stream.subscription import subscribe
from tests.helpers.streamed import bump_daemon


@pytest.mark.parametrize("every", [False, True])
def test_without_shared_memory_frames_go_through_the_network(monkeypatch: pytest.MonkeyPatch, every: bool) -> None:
    monkeypatch.delattr(os, "memfd_create")
    daemon, made = bump_daemon()
    with daemon, Publisher(daemon, name="finger"), subscribe("finger", every=every) as frames:
        assert running()[0].memory == ""
        got = frames.next_frame()
        assert np.array_equal(got.depth_mm, made.given[got.camera_frame.sequence].depth_mm)


def test_a_frame_for_which_there_is_no_memory_goes_through_the_network(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    daemon, made = bump_daemon()
    with daemon, Publisher(daemon, name="finger"), subscribe("finger") as frames:
        got = frames.next_frame()
        assert np.array_equal(got.depth_mm, made.given[got.camera_frame.sequence].depth_mm)
    assert "No space left" in caplog.text


def test_memory_that_cannot_be_opened_is_no_obstacle(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "other").symlink_to(tmp_path / "elsewhere")
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger"):
        for path in ("/proc/0/fd/3", str(tmp_path / "other")):
            found = running()[0].model_copy(update={"memory": path})
            monkeypatch.setattr(subscription, "running", lambda found=found: [found])
            with subscribe("finger") as frames:
                frames.next_frame()


def test_publishers_and_readers_that_ended_leave_nothing_behind() -> None:
    def held() -> tuple[int, int]:
        return len(list(Path("/proc/self/fd").iterdir())), len(list(Path("/dev/shm").glob("*.zenoh")))

    def once() -> None:
        daemon, _ = bump_daemon()
        with daemon, Publisher(daemon), subscribe() as one, subscribe(every=True) as other:
            one.next_frame()
            other.next_frame()

    once()
    before = held()
    for _ in range(3):
        once()
    assert held() == before


@pytest.mark.parametrize("every", [False, True])
def test_a_subscription_that_is_dropped_lets_go_of_what_it_holds(every: bool) -> None:
    """Zenoh holds what it calls when messages come: that must not be the subscription."""

    def dropped() -> "weakref.ref[subscription.Subscription]":
        frames = subscribe("finger", every=every, maps=["confidence"])
        frames.next_frame()
        return weakref.ref(frames)

    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon, name="finger"):
        dropped()
        gc.collect()
        before = len(list(Path("/proc/self/fd").iterdir()))
        references = [dropped() for _ in range(4)]
        gc.collect()
        assert [reference() for reference in references] == [None] * 4
        assert len(list(Path("/proc/self/fd").iterdir())) == before
