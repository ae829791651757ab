"""Frames in memory that publisher and readers share: whole, never torn, and over the network where there is none."""

import errno
import gc
import itertools
import mmap
import os
import threading
import time
import weakref
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import StreamError
from gellight.stream import subscription
from gellight.stream.publisher import Publisher
from gellight.stream.running import running
from gellight.stream.shared_memory import NOTE, PLACES, FrameMemory, MappedMemory, OverwrittenError
from gellight.stream.subscription import subscribe
from tests.helpers.streamed import bump_daemon


@pytest.fixture
def memory():
    memory = FrameMemory()
    yield memory
    memory.close()


@pytest.fixture
def reader(memory: FrameMemory):
    reader = MappedMemory(memory.path)
    yield reader
    reader.close()


def test_messages_arrive_in_pieces_and_whole_until_they_have_made_room(
    memory: FrameMemory, reader: MappedMemory
) -> None:
    notes = [memory.write([b"one", memoryview(bytes([n] * 10_000))]) for n in range(PLACES - 1)]
    assert [reader.read(note) for note in notes] == [b"one" + bytes([n] * 10_000) for n in range(PLACES - 1)]
    memory.write([b"later"])
    with pytest.raises(OverwrittenError):
        reader.read(notes[0])
    assert reader.read(b"a message for which there was no memory") == b"a message for which there was no memory"


def test_memory_grows_with_its_messages(memory: FrameMemory, reader: MappedMemory) -> None:
    small = memory.write([b"small"])
    assert reader.read(small) == b"small"
    large = bytes(range(256)) * 100_000
    assert reader.read(memory.write([large])) == large
    with pytest.raises(OverwrittenError):
        reader.read(small)


@pytest.mark.parametrize("note", [NOTE.pack(0, 1 << 40, 1), NOTE.pack(1 << 63, 1, 1), NOTE.pack(1, (1 << 64) - 1, 0)])
def test_a_note_beyond_the_memory_is_refused(memory: FrameMemory, reader: MappedMemory, note: bytes) -> None:
    memory.write([b"message"])
    with pytest.raises(StreamError, match="is it of this version"):
        reader.read(note)


def test_memory_is_given_back_when_its_reader_has_the_message_and_then_is_closed(
    memory: FrameMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader = MappedMemory(memory.path)
    note, expect, closing = memory.write([b"message"]), reader._expect, threading.Thread(target=reader.close)

    def close_meanwhile(places: mmap.mmap, number: int) -> None:
        if not closing.ident:
            closing.start()
            closing.join(0.2)
        expect(places, number)

    monkeypatch.setattr(reader, "_expect", close_meanwhile)
    assert reader.read(note) == b"message"
    closing.join(20)
    with pytest.raises(StreamError, match="the subscription was closed"):
        reader.read(note)


def test_only_memory_of_frames_is_opened(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"private")
    with (tmp_path / "file").open("rb") as file, pytest.raises(OSError, match="no memory of frames"):
        MappedMemory(f"/proc/{os.getpid()}/fd/{file.fileno()}")


def test_no_message_is_ever_torn(memory: FrameMemory) -> None:
    """A writer without a pause, and a reader that is often too late: what it takes is of one message."""
    newest, enough = [memory.write([bytes(8) * 25_000])], threading.Event()

    def write() -> None:
        for n in itertools.count():
            newest[0] = memory.write([n.to_bytes(8, "little") * 12_500] * 2)
            if enough.is_set():
                return

    reader, taken, late = MappedMemory(memory.path), 0, 0
    writer = threading.Thread(target=write)
    writer.start()
    old, until_s = newest[0], time.monotonic() + 60
    try:
        while (taken < 100 or late < 100) and time.monotonic() < until_s:
            for note in (newest[0], old):
                try:
                    message = reader.read(note)
                except OverwrittenError:
                    late += 1
                    continue
                taken += 1
                assert message == message[:8] * 25_000
            old = newest[0]
    finally:
        enough.set()
        writer.join()
        reader.close()
    assert min(taken, late) >= 100, (taken, late)


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
    monkeypatch.setattr(os, "posix_fallocate", Mock(side_effect=OSError(errno.ENOSPC, "No space left on device")))
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
        mapped = Path("/proc/self/maps").read_text()  # of this process: others that run beside it come and go
        return len(list(Path("/proc/self/fd").iterdir())), mapped.count("/dev/shm/")

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
