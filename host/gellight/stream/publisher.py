"""Publishes the frames of a running daemon to other programs, and answers their calls.

A thread of its own takes the newest frame and sends it, as long as somebody subscribes. Who reads too slowly, or not at
all, loses frames and slows neither the sensor nor the other readers. Readers on this computer get frames through shared
memory, others over the network.
"""

import logging
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

import zenoh

from gellight.base.errors import GellightError
from gellight.daemon.daemon import Daemon
from gellight.frames.camera import Camera
from gellight.frames.frames import TactileFrame
from gellight.stream.calls import answer, read_call
from gellight.stream.frame_thread import POLL_S, sending
from gellight.stream.network import close, free_lan_port, key, publishing_session
from gellight.stream.running import RunningDaemon, announced
from gellight.stream.shared_memory import SharedMemory
from gellight.stream.wire import MOST_DETAILS, encoded

logger = logging.getLogger(__name__)


def own_name(camera: Camera) -> str:
    """Return the serial number or USB port of a real sensor; empty for others, of which there may be several."""
    return str(camera.status().get("name", ""))


def name_of_sensor(camera: Camera) -> str:
    """Return the name that a sensor has for other programs, unless another one is given."""
    return own_name(camera) or urlsplit(camera.url).scheme or "images"


class Publisher:
    """Publishes a daemon that was started; a context manager."""

    def __init__(self, daemon: Daemon, *, name: str = "", lan: bool = False, config: Path | None = None) -> None:
        """Publish `daemon` under `name`, by default that of its sensor; the rest: `network.publishing_session`."""
        self._daemon, self._asked, self._lan, self._config = daemon, name, lan, config
        self._until = ExitStack()
        self._wanted, self._memory = threading.Event(), SharedMemory()
        self._held: tuple[object, ...] = ()
        """zenoh withdraws what nobody holds"""
        self.name = ""
        """under which it is published"""
        self.lan_port = 0
        """where other computers connect to; 0: they cannot"""
        self.frames = 0
        """that were published"""

    def __enter__(self) -> Self:
        """Announce the sensor and start; raises StreamError, and then nothing is left behind."""
        with ExitStack() as stack:
            self.lan_port = free_lan_port() if self._lan else 0
            session, endpoint = publishing_session(lan=self._lan, config=self._config, lan_port=self.lan_port)
            stack.callback(close, session)
            self.name = name = stack.enter_context(self._announced(endpoint)).name
            publisher = session.declare_publisher(
                key(name, "frame"), congestion_control=zenoh.CongestionControl.DROP, encoding="application/x-gellight"
            )
            publisher.declare_matching_listener(self._note_readers)
            self._workers = ThreadPoolExecutor(1, thread_name_prefix="calls")
            stack.callback(self._workers.shutdown, wait=True, cancel_futures=True)
            calls = session.declare_queryable(key(name, "call"), lambda one: self._workers.submit(self._answer, one))
            self._held = calls, session.liveliness().declare_token(key(name, "alive"))
            self._publisher = publisher
            stack.enter_context(sending(self._daemon, "publish", self._send, lambda: self._wanted.wait(POLL_S)))
            self._until = stack.pop_all()
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop publishing; readers learn that the daemon is gone."""
        self._until.close()

    def _announced(self, endpoint: str) -> AbstractContextManager[RunningDaemon]:
        camera = self._daemon.camera
        numbered = not (self._asked or own_name(camera))
        return announced(self._asked or name_of_sensor(camera), endpoint, camera.url, numbered=numbered)

    def _note_readers(self, status: zenoh.MatchingStatus) -> None:
        if status.matching:
            self._wanted.set()
        else:
            self._wanted.clear()

    def _send(self, frame: TactileFrame) -> None:
        self._publisher.put(self._memory.holding(encoded(frame)))
        self.frames += 1

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            try:
                content = query.payload.to_bytes() if query.payload else b""
                query.reply(query.key_expr, answer(self._daemon, read_call(content[:MOST_DETAILS])))
            except (GellightError, ValueError) as error:
                query.reply_err(str(error))
            except Exception:
                logger.exception("a call failed")
                query.reply_err("the call failed in the daemon; its log says why")
