"""A callback gets frames until the source is closed: an absence of the sensor is told, and no end goes unheard."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from queue import SimpleQueue
from typing import Any

import pytest

from gellight.base.errors import InputError, StreamError
from gellight.daemon.session import SensorSession
from gellight.frames.camera import EndOfStream, ReconnectingError
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.stream import source
from gellight.stream.publisher import Publisher
from gellight.stream.sensor import Sensor
from gellight.stream.source import FrameSource, NoFrameError
from gellight.stream.subscription import subscribe
from tests.helpers.scripted_camera import ScriptedCamera
from tests.helpers.sessions import session_of
from tests.helpers.streamed import SHAPE, BumpReconstructor, bump_daemon
from tests.helpers.waiting import eventually

PATIENCE_S = 0.2


class PluggedCamera(ScriptedCamera):
    """Gives frames while it is plugged in."""

    def __init__(self) -> None:
        super().__init__(shape=SHAPE, period_s=0.01)
        self.plugged = threading.Event()
        self.plugged.set()

    def read(self) -> CameraFrame:
        if not self.plugged.is_set():
            time.sleep(0.01)
            raise ReconnectingError("it was unplugged")
        return super().read()


@contextmanager
def in_this_process(daemon: SensorSession) -> Iterator[FrameSource]:
    with Sensor(daemon, patience_s=PATIENCE_S) as frames:
        yield frames


@contextmanager
def in_another(daemon: SensorSession) -> Iterator[FrameSource]:
    with daemon, Publisher(daemon), subscribe(patience_s=PATIENCE_S) as frames:
        yield frames


def next_of(queue: "SimpleQueue[Any]") -> Any:
    return queue.get(timeout=60)


def newest_of(queue: "SimpleQueue[Any]") -> Any:
    """Return what comes after whatever waits in the queue."""
    while not queue.empty():
        queue.get()
    return next_of(queue)


@pytest.mark.parametrize("opened", [in_this_process, in_another])
def test_a_callback_outlives_an_absence_of_the_sensor_and_is_told_of_it(opened: Callable[[SensorSession], Any]) -> None:
    camera: Any = PluggedCamera()
    seen: SimpleQueue[TactileFrame] = SimpleQueue()
    told: SimpleQueue[Exception] = SimpleQueue()
    with opened(session_of(camera, BumpReconstructor())) as frames:
        frames.listen(seen.put, told.put)
        next_of(seen)
        for _ in range(2):
            camera.plugged.clear()
            while "unplugged" not in str(first := next_of(told)):  # a busy machine has absences of its own
                continue
            assert isinstance(first, NoFrameError)
            assert str(first) == str(next_of(told)) == "no frame for 0.2 s: it was unplugged"
            camera.plugged.set()
            newest_of(seen)
            while not told.empty():
                told.get()


def test_an_absence_is_logged_once_where_nobody_asks_to_be_told(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera: Any = PluggedCamera()
    seen: SimpleQueue[TactileFrame] = SimpleQueue()

    def said() -> list[str]:
        messages = [record.message for record in caplog.records if record.name == "gellight.stream.source"]
        return [message for message in messages if "unplugged" in message]  # a busy machine has absences of its own

    with in_this_process(session_of(camera, BumpReconstructor())) as frames:
        waits, why = [], frames._why_none
        monkeypatch.setattr(frames, "_why_none", lambda: waits.append(why()) or waits[-1])
        frames.listen(seen.put)
        for absences in (1, 2):
            newest_of(seen)
            camera.plugged.clear()
            before = len(waits)
            eventually(lambda before=before: len(waits) > before + 3)
            assert said() == ["no frame for 0.2 s: it was unplugged"] * absences
            camera.plugged.set()


def test_the_last_frame_is_told_and_raised_at_the_end_or_logged(caplog: pytest.LogCaptureFixture) -> None:
    told: SimpleQueue[Exception] = SimpleQueue()
    daemon, _ = bump_daemon(frames=3)

    def listening() -> None:
        with Sensor(daemon) as frames:
            frames.listen(lambda frame: None, told.put)
            assert isinstance(next_of(told), EndOfStream)

    with pytest.raises(EndOfStream, match="used up"):
        listening()
    daemon, _ = bump_daemon(frames=3)
    frames = Sensor(daemon)
    frames.listen(lambda frame: None)
    frames._listening[0].join(60)
    with pytest.raises(EndOfStream):
        frames.close()
    assert [record.message for record in caplog.records] == ["a callback is called no more: used up"]


def test_a_daemon_that_ends_is_told_to_a_callback_once() -> None:
    told: SimpleQueue[Exception] = SimpleQueue()
    daemon, _ = bump_daemon()
    with daemon:
        publisher = Publisher(daemon, name="finger").__enter__()
        frames = subscribe("finger")
        frames.listen(lambda frame: None, told.put)
        frames.next_frame()
        publisher.__exit__()
        assert "daemon of finger has ended" in str(next_of(told))
        with pytest.raises(StreamError, match="daemon of finger has ended"):
            frames.close()
    assert told.empty()


def test_what_a_callback_raises_while_the_source_is_closed_is_not_lost() -> None:
    daemon, _ = bump_daemon()
    called, closing = threading.Event(), threading.Event()

    def fail(frame: TactileFrame) -> None:
        called.set()
        assert closing.wait(60)
        time.sleep(0.1)
        raise ZeroDivisionError("in the callback")

    frames = Sensor(daemon)
    frames.listen(fail)
    assert called.wait(60)
    closing.set()
    with pytest.raises(ZeroDivisionError):
        frames.close()


def test_a_callback_that_does_not_return_is_told_and_the_rest_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "CALLBACK_S", 0.05)
    camera, called, released = PluggedCamera(), threading.Event(), threading.Event()

    def hang(frame: TactileFrame) -> None:
        called.set()
        released.wait(60)

    frames = Sensor(session_of(camera, BumpReconstructor()))
    frames.listen(hang)
    assert called.wait(60)
    with pytest.raises(StreamError, match=r"has not returned for 0\.05 s: it runs on"):
        frames.close()
    assert camera.closed
    released.set()


@pytest.mark.parametrize("close_of", ["connect", "subscribe"])
def test_a_loop_ends_when_another_thread_closes_its_source(close_of: str) -> None:
    daemon, _ = bump_daemon()
    with ExitStack() as stack:
        if close_of == "subscribe":
            stack.enter_context(daemon)
            stack.enter_context(Publisher(daemon, name="finger"))
        source = subscribe("finger") if close_of == "subscribe" else Sensor(daemon)
        said: list[object] = []

        def loop() -> None:
            try:
                said.extend(frame.camera_frame.sequence for frame in source)
            except Exception as error:
                said.append(error)
            said.append("ended")

        thread = threading.Thread(target=loop)
        thread.start()
        time.sleep(0.5)
        source.close()
        thread.join(60)
    assert said[-1] == "ended"
    assert all(isinstance(one, int) for one in said[:-1]), said[-2:]


def test_a_source_that_gives_every_frame_has_one_reader() -> None:
    daemon, _ = bump_daemon()
    with Sensor(daemon, every=True) as source:
        source.listen(lambda frame: None)
        with pytest.raises(InputError, match="one listener: open another source"):
            source.listen(lambda frame: None)
        with pytest.raises(InputError, match="the listener gets all frames: open another source"):
            source.next_frame()
