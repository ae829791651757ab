"""Live view in Foxglove: the messages of ROS 2 by WebSocket, with the package foxglove-sdk.

One server shows one sensor, so topics have the same names for every sensor and one layout fits: `/gellight/image_raw`,
`/gellight/depth/image` and so on, see ros_topics.py, and `/diagnostics` once a second. Topics that nobody looks at cost
nothing. A viewer may look and do nothing else.

The server does not look where its clients come from, so a door before it keeps web pages of strangers outside: a
browser says by Origin which page connects. Programs send none, and Foxglove's desktop application a file's.
"""

import asyncio
import secrets
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Self
from urllib.parse import urlsplit

from gellight.base import logs
from gellight.base.errors import StreamError, needed
from gellight.base.settings import Settings
from gellight.daemon.session import SensorSession
from gellight.frames.frames import TactileFrame
from gellight.stream.frame_thread import sending
from gellight_ros.ros_topics import DIAGNOSTICS_S, DIAGNOSTICS_TOPIC, RosTopics, taken_s, topic_of
from gellight_ros.ros_types import DEFINITIONS, DIAGNOSTICS

if TYPE_CHECKING:
    from foxglove import Channel

NAME = "gellight"
"""of every sensor in topics and coordinate frames"""
BACKLOG = 20
"""messages that wait for a slow viewer, those of four frames; older ones are dropped"""
MOST_HEAD_BYTES = 1 << 14
HEAD_S = 10.0
PIECE_BYTES = 1 << 20
REFUSED = b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


@contextmanager
def to_foxglove(daemon: SensorSession, name: str, settings: Settings) -> Iterator[None]:
    """Serve on `stream.foxglove_port`, as long as the context lasts, and say where; StreamError where that fails."""
    chosen = settings.stream
    with FoxgloveServer(daemon, name=name, port=chosen.foxglove_port, lan=chosen.lan) as view:
        logs.say(f"Foxglove: open {view.url}")
        yield


class FoxgloveServer:
    """Shows a daemon that runs; a context manager."""

    def __init__(self, daemon: SensorSession, *, name: str, port: int, lan: bool = False) -> None:
        """Serve on `port`, 0 for a free one, of 127.0.0.1, or with `lan` of every network. name: shown in Foxglove."""
        self._daemon, self._name, self._port, self._host = daemon, name, port, "0.0.0.0" if lan else "127.0.0.1"
        self._messages = RosTopics(daemon, NAME)
        self._diagnosed_s = 0.0
        self._until = ExitStack()
        self.url = ""
        """that Foxglove opens, as seen from this computer"""

    def __enter__(self) -> Self:
        """Start; raises StreamError where the package is missing or the port is in use."""
        with needed("Foxglove needs a package: pip install foxglove-sdk", StreamError):
            import foxglove
        self._context = context = foxglove.Context()  # the server and its channels end with it

        def channel(topic: str, kind: str) -> "Channel":
            schema = foxglove.Schema(name=kind, encoding="ros2msg", data=DEFINITIONS[kind].encode())
            made = foxglove.Channel(topic, schema=schema, message_encoding="cdr", context=context)
            stack.callback(made.close)
            return made

        inner = ".".join(map(str, (127, *secrets.token_bytes(2), 1))) if sys.platform == "linux" else "127.0.0.1"
        with ExitStack() as stack:  # the server itself is where no page finds it
            topics = self._messages.of_frames
            self._channels = [
                (channel(topic_of(f"/{NAME}", name), kind), encode) for name, (kind, encode) in topics.items()
            ]
            self._diagnostics = channel(DIAGNOSTICS_TOPIC, DIAGNOSTICS)
            try:
                server = foxglove.start_server(
                    name=f"GelLight {self._name}", host=inner, port=0, context=context,
                    supported_encodings=["cdr"], message_backlog_size=BACKLOG,
                )  # fmt: skip
            except RuntimeError as error:
                raise StreamError(f"Foxglove cannot be served ({error})") from error
            stack.callback(server.stop)
            self.url = f"ws://localhost:{stack.enter_context(guarded(self._host, self._port, (inner, server.port)))}"
            stack.enter_context(sending(self._daemon, "foxglove", self._send, self._diagnose))
            self._until = stack.pop_all()
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop; viewers are disconnected."""
        self._until.close()

    def _diagnose(self) -> bool:
        """Send the diagnostics when they are due; return whether a frame is wanted too."""
        if self._diagnostics.has_sinks() and time.monotonic() - self._diagnosed_s >= DIAGNOSTICS_S:
            self._diagnosed_s = time.monotonic()
            self._diagnostics.log(self._messages.diagnostics())
        return True

    def _send(self, frame: TactileFrame) -> None:
        for channel, encode in self._channels:
            if channel.has_sinks() and (content := encode(frame)) is not None:
                channel.log(content, log_time=round(taken_s(frame) * 1e9))


def is_welcome(origin: str) -> bool:
    """Whether a page may connect: Foxglove's own, one of this computer, or none at all."""
    parts = urlsplit(origin)
    host = parts.hostname or ""
    if parts.scheme in ("http", "https"):
        return host in ("localhost", "127.0.0.1", "::1") or f".{host}".endswith(".foxglove.dev")
    return origin in ("", "file://")


@contextmanager
def guarded(host: str, port: int, inner: tuple[str, int]) -> Iterator[int]:
    """Listen on `host` and `port` (0: a free one) for the server at `inner`; yield the port, StreamError if in use."""
    try:
        listener = socket.create_server((host, port))
    except OSError as error:
        raise StreamError(
            f"Foxglove cannot be served on port {port} ({error.strerror}): set stream.foxglove_port to another one"
        ) from error
    loop, stop = asyncio.new_event_loop(), asyncio.Event()

    async def welcome(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError, ValueError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            await _pass(reader, writer, inner)
        writer.close()

    async def serve() -> None:
        async with await asyncio.start_server(welcome, sock=listener, limit=MOST_HEAD_BYTES):
            await stop.wait()
            for task in asyncio.all_tasks() - {asyncio.current_task()}:
                task.cancel()

    thread = threading.Thread(target=loop.run_until_complete, args=(serve(),), name="foxglove door", daemon=True)
    thread.start()
    try:
        yield int(listener.getsockname()[1])
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join()
        loop.close()


async def _pass(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, inner: tuple[str, int]) -> None:
    head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), HEAD_S)
    lines = head.decode("latin-1").split("\r\n")[1:]
    origins = [line.partition(":")[2].strip() for line in lines if line.lower().startswith("origin:")]
    if not all(map(is_welcome, origins)):
        writer.write(REFUSED)
        await writer.drain()
        return
    there, to_there = await asyncio.open_connection(*inner)
    to_there.write(head)
    ways = [asyncio.ensure_future(_carry(*way)) for way in ((reader, to_there), (there, writer))]
    try:
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for way in ways:
            way.cancel()
        to_there.close()


async def _carry(source: asyncio.StreamReader, target: asyncio.StreamWriter) -> None:
    while piece := await source.read(PIECE_BYTES):
        target.write(piece)
        await target.drain()
