"""A door before a WebSocket server that does not look where its clients come from: web pages of strangers stay outside.

A browser says by Origin which page connects. Programs send none, and Foxglove's desktop application a file's.
"""

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

from gellight.base.errors import StreamError

MOST_HEAD_BYTES = 1 << 14
HEAD_S = 10.0
PIECE_BYTES = 1 << 20
REFUSED = b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


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
