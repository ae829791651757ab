"""The thread that gives a daemon's newest frame to whatever publishes it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from gellight.daemon.daemon import Daemon
from gellight.frames.frames import TactileFrame

POLL_S = 0.5
"""how often the thread looks whether it should stop"""


@contextmanager
def sending(
    daemon: Daemon, name: str, send: Callable[[TactileFrame], None], wanted: Callable[[], bool] = lambda: True
) -> Iterator[None]:
    """Call `send` with the newest frame, again and again, in a thread called `name`, as long as the context lasts.

    wanted: called before each frame; says whether one is needed, and may wait up to `POLL_S` until one is. A `send`
    that is slow gets fewer frames and slows nothing else.
    """
    ended = threading.Event()

    def work() -> None:
        number = 0
        while not ended.is_set():
            if not wanted():
                continue
            try:
                number, frame = daemon.delivered.take(number, POLL_S)
            except TimeoutError:
                continue
            except Exception:
                return  # the frames have ended; the program that runs the daemon gets the reason
            send(frame)

    thread = threading.Thread(target=work, name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
