"""Clients of the dashboard: one that speaks as the page does, and one that asks for a single file."""

import asyncio
import json
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import aiohttp
from aiohttp import WSMsgType

from gellight.base.runtime_folder import own_token
from tests.helpers.view_messages import View, decode

FRAME_S = 60.0
"""more than any frame needs, even on a loaded machine"""
SILENCE_S = 0.6
"""without a frame for this time, none comes"""
ENDED = (WSMsgType.CLOSE, WSMsgType.CLOSED)


class Page:
    """A client that speaks as the page does; it reads only while it is asked for something."""

    def __init__(self, runner: asyncio.Runner, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._runner, self.socket = runner, socket

    def _first(self, wanted: Callable[[aiohttp.WSMessage], bool], timeout_s: float) -> aiohttp.WSMessage:
        """Return the next message that is wanted; TimeoutError where none comes."""

        async def read() -> aiohttp.WSMessage:
            async with asyncio.timeout(timeout_s):
                while not wanted(message := await self.socket.receive()):
                    assert message.type in (WSMsgType.TEXT, WSMsgType.BINARY), message
            return message

        return self._runner.run(read())

    def send(self, content: str | bytes = b"", **said: object) -> None:
        """Send text or bytes as they are, or else JSON."""
        if isinstance(content, str):
            self._runner.run(self.socket.send_str(content))
        elif content:
            self._runner.run(self.socket.send_bytes(content))
        else:
            self._runner.run(self.socket.send_json(said))

    def credit(self, count: int = 1) -> None:
        self.send(count=count)

    def message(self, timeout_s: float = FRAME_S) -> View:
        return decode(self._first(lambda message: message.type is WSMsgType.BINARY, timeout_s).data)

    def frame(self) -> dict[str, Any]:
        return self.message().header

    def text(self, *kinds: str) -> dict[str, Any]:
        """Return the next text message of one of `kinds`."""

        def wanted(message: aiohttp.WSMessage) -> bool:
            return message.type is WSMsgType.TEXT and json.loads(message.data)["type"] in kinds

        return dict(json.loads(self._first(wanted, FRAME_S).data))

    def is_silent(self) -> bool:
        try:
            self.message(SILENCE_S)
        except TimeoutError:
            return True
        return False

    def is_closed(self) -> bool:
        """Wait until the server has closed the connection."""
        return self._first(lambda message: message.type in ENDED, FRAME_S).type in ENDED


@contextmanager
def pages(**options: Any) -> Iterator[Callable[..., Page]]:
    """Give what connects a page, with this user's token, to the address of a server; options: of the session."""

    async def begin() -> aiohttp.ClientSession:
        return aiohttp.ClientSession(**{"headers": bearer()} | options)

    with asyncio.Runner() as runner:
        session = runner.run(begin())

        async def connect(url: str, **how: Any) -> aiohttp.ClientWebSocketResponse:
            return await session.ws_connect(url + "ws", max_msg_size=0, **how)

        yield lambda url, **how: Page(runner, runner.run(connect(url, **how)))
        runner.run(session.close())


def bearer() -> dict[str, str]:
    """Return the header of a program of this user."""
    return {"Authorization": f"Bearer {own_token()}"}


def post(base: str, call: object, **headers: str) -> tuple[int, dict[str, Any]]:
    """Ask for something, or send bytes as they are; return the status and what is answered."""
    content = call if isinstance(call, bytes) else json.dumps(call).encode()
    headers = {"Content-Type": "application/json", **bearer(), **headers}
    try:
        with urllib.request.urlopen(urllib.request.Request(base + "command", content, headers)) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as error:
        text = error.read().decode()
        return error.code, json.loads(text) if text.startswith("{") else {"message": text}


def get(url: str, **options: Any) -> tuple[int, str, Mapping[str, str]]:
    """Return status, text and headers of the answer to a request of this user; options: of aiohttp's `get`."""
    options["headers"] = bearer() | options.get("headers", {})

    async def run() -> tuple[int, str, Mapping[str, str]]:
        async with aiohttp.ClientSession() as session, session.get(url, allow_redirects=False, **options) as response:
            return response.status, await response.text(), response.headers

    return asyncio.run(run())
