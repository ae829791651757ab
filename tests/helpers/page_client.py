"""A client of the dashboard that speaks as the page does."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

import aiohttp

from gellight.dashboard.server import DashboardServer
from tests.helpers.view_messages import decode

FRAME_S = 5.0
"""more than any frame needs, even on a loaded machine"""
SILENCE_S = 0.6
"""without a frame for this time, none comes"""


class Page:
    """A client that speaks as the page does."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket

    async def send(self, **command: object) -> None:
        await self.socket.send_json(command)

    async def credit(self, count: int = 1) -> None:
        await self.send(type="credit", count=count)

    async def frame(self, timeout_s: float = FRAME_S) -> dict[str, Any]:
        """Return the header of the next frame."""
        async with asyncio.timeout(timeout_s):
            while True:
                message = await self.socket.receive()
                if message.type is aiohttp.WSMsgType.BINARY:
                    return decode(message.data).header
                assert message.type is aiohttp.WSMsgType.TEXT, message

    async def text(self, *kinds: str) -> dict[str, Any]:
        """Return the next text message of one of `kinds`."""
        async with asyncio.timeout(FRAME_S):
            while True:
                message = await self.socket.receive()
                assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY), message
                if message.type is aiohttp.WSMsgType.TEXT and (found := json.loads(message.data))["type"] in kinds:
                    return found

    async def answer(self, **command: object) -> dict[str, Any]:
        await self.send(**command)
        return await self.text("done", "error")

    async def is_silent(self) -> bool:
        try:
            await self.frame(SILENCE_S)
        except TimeoutError:
            return True
        return False


def with_pages(server: DashboardServer, count: int, act: Callable[..., Awaitable[None]]) -> None:
    """Run `act` with `count` connected pages."""

    async def run() -> None:
        async with aiohttp.ClientSession() as session:
            sockets = [await session.ws_connect(server.url + "ws", max_msg_size=0) for _ in range(count)]
            await act(*(Page(socket) for socket in sockets))

    asyncio.run(run())


def get(server: DashboardServer, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    """Return status, text and headers of the answer to a request for `path`."""

    async def run() -> tuple[int, str, dict[str, str]]:
        async with aiohttp.ClientSession() as session, session.get(server.url + path, headers=headers) as response:
            return response.status, await response.text(), dict(response.headers)

    return asyncio.run(run())
