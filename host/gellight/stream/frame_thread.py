"""The thread that gives a daemon's newest frame to whatever publishes it."""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points

from gellight.base.errors import StreamError
from gellight.daemon.session import SensorSession
from gellight.frames.camera import EndOfStream
from gellight.frames.frames import TactileFrame

logger = logging.getLogger(__name__)
POLL_S = 0.5
"""how often the thread looks whether it should stop"""


@contextmanager
def sending(
    daemon: SensorSession, name: str, send: Callable[[TactileFrame], None], wanted: Callable[[], bool] = lambda: True
) -> Iterator[None]:
    """Call `send` with the newest frame, again and again, in a thread called `name`, as long as the context lasts.

    wanted: called before each frame; says whether one is needed, and may wait up to `POLL_S` until one is. A `send`
    that is slow gets fewer frames and slows nothing else. What either raises is logged once, and the next frame tried.
    """
    ended = threading.Event()

    def work() -> None:
        number, problem = 0, ""
        while not ended.is_set():
            try:
                if not wanted():
                    continue
                number, frame = _newest(daemon, number)
                if frame is not None:
                    send(frame)
                    problem = ""
            except EndOfStream:
                return  # the program that runs the daemon gets the reason
            except Exception as error:
                if problem != str(error):
                    logger.exception("%s: a frame cannot be sent", name)
                problem = str(error)
                ended.wait(POLL_S)

    thread = threading.Thread(target=work, name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _newest(daemon: SensorSession, after: int) -> tuple[int, TactileFrame | None]:
    """Return the newest frame and its number, None where none comes; EndOfStream where the frames have ended."""
    try:
        return daemon.delivered.take(after, POLL_S)
    except TimeoutError:
        return after, None
    except Exception as error:
        raise EndOfStream(str(error)) from error


@contextmanager
def sent_to(sink: str, daemon: SensorSession, name: str) -> Iterator[None]:
    """Send the frames of a daemon to a sink, as long as the context lasts; StreamError where none has this name."""
    found = entry_points(group="gellight.sinks", name=sink)
    if not found:
        known = ", ".join(sorted(entry_points(group="gellight.sinks").names)) or "none is installed"
        raise StreamError(f"no installed distribution has a sink {sink!r} ({known}): install one, or leave it out")
    with next(iter(found)).load()(name) as send, sending(daemon, sink, send):
        yield
