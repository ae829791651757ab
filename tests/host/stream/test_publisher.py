"""What a publisher sends goes on, whatever its readers, zenoh and a single frame do."""

import threading
from types import SimpleNamespace
from typing import Any

import pytest

from gellight.base.errors import StreamError
from gellight.frames.frames import TactileFrame
from gellight.stream import publisher as publisher_module
from gellight.stream.frame_thread import sending
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from tests.helpers.streamed import bump_daemon


class HeldEvent(threading.Event):
    """An event that waits in `clear` until it is told to go on, or half a second is over."""

    def __init__(self) -> None:
        super().__init__()
        self.clearing, self.go_on = threading.Event(), threading.Event()

    def clear(self) -> None:
        self.clearing.set()
        self.go_on.wait(0.5)
        super().clear()


def test_a_reader_that_comes_while_the_last_one_leaves_is_noted() -> None:
    """Zenoh tells of the readers of notes and of frames in two threads."""
    daemon, _ = bump_daemon()
    publisher: Any = Publisher(daemon)
    publisher._wanted = event = HeldEvent()
    publisher._note_readers("note", SimpleNamespace(matching=True))
    leaving = threading.Thread(target=publisher._note_readers, args=("note", SimpleNamespace(matching=False)))
    leaving.start()
    assert event.clearing.wait(20)
    coming = threading.Thread(target=publisher._note_readers, args=("frame", SimpleNamespace(matching=True)))
    coming.start()
    coming.join(0.1)  # with a lock it waits here
    event.go_on.set()
    leaving.join()
    coming.join()
    assert event.is_set()


def test_a_frame_that_cannot_be_sent_ends_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    known, refused = publisher_module.encoded, threading.Semaphore(3)

    def encoded(frame: TactileFrame, asked: Any) -> Any:
        if refused.acquire(blocking=False):
            raise StreamError("this one not")
        return known(frame, asked)

    monkeypatch.setattr(publisher_module, "encoded", encoded)
    daemon, _ = bump_daemon()
    with daemon, Publisher(daemon), subscribe(patience_s=20) as frames:
        frames.next_frame()
    assert [record.message for record in caplog.records] == ["publish: a frame cannot be sent"], "said once"


def test_a_question_that_fails_ends_nothing() -> None:
    """As the status, which ROS 2 and Foxglove ask for once a second."""
    asked, sent = iter([ValueError("not now"), None]), threading.Event()

    def wanted() -> bool:
        problem = next(asked, None)
        if problem is not None:
            raise problem
        return True

    daemon, _ = bump_daemon()
    with daemon, sending(daemon, "asking", lambda frame: sent.set(), wanted):
        assert sent.wait(20)
