"""One page for several sensors, each of which has a dashboard of its own on this machine.

`/KEY/...` is passed on to the dashboard of a sensor, frames and commands too, and `/sensors` lists them, from which the
page makes its chooser. A sensor that has failed is listed with the reason.
"""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass

import aiohttp
from aiohttp import WSMsgType, web

from gellight.dashboard.access import guard
from gellight.dashboard.application import MAX_COMMAND_BYTES

PASSED_ON = ("Content-Type", "Accept-Encoding", "If-None-Match")
PASSED_BACK = (
    "Content-Type", "Content-Encoding", "ETag", "Cache-Control", "Vary", "Content-Security-Policy",
)  # fmt: skip
REPORTS = "calibration/report/"
"""pages with a policy of their own"""
RETRY_AFTER_S = 1
"""a sensor that is being started is asked for again"""
Either = web.WebSocketResponse | aiohttp.ClientWebSocketResponse


@dataclass(frozen=True, kw_only=True)
class Choice:
    """One of the sensors."""

    key: str
    """in the address of its page"""
    sensor: str
    """its URL or its name"""
    error: str | None
    """why it gives no frames; None while it does"""
    address: str
    """of its own dashboard, `http://127.0.0.1:PORT/?token=TOKEN`; empty while there is none"""


class Chooser:
    """The web application for several sensors."""

    def __init__(self, choices: Callable[[], Mapping[str, Choice]]) -> None:
        """Take what returns the sensors by their keys, as they are now."""
        self._choices = choices

    def application(self, token: str) -> web.Application:
        """Return the aiohttp application; token: see access.py."""
        app = web.Application(middlewares=[guard(token)], client_max_size=MAX_COMMAND_BYTES)
        app.router.add_get("/", self._lead_to_first)
        app.router.add_get("/sensors", self._list)
        app.router.add_get("/health", self._show_health)
        app.router.add_get("/{key}/ws", self._relay)
        app.router.add_route("*", "/{key}/{path:.*}", self._pass_on)
        app.cleanup_ctx.append(self._with_client)
        return app

    async def _with_client(self, app: web.Application):  # type: ignore[no-untyped-def]  # aiohttp's form of a fixture
        async with aiohttp.ClientSession(auto_decompress=False) as self._client:
            yield

    async def _lead_to_first(self, request: web.Request) -> web.Response:
        choices = list(self._choices().values())
        first = next((choice for choice in choices if choice.address), choices[0])
        raise web.HTTPFound(f"{first.key}/")

    async def _list(self, request: web.Request) -> web.Response:
        return web.json_response([_shown(choice) for choice in self._choices().values()])

    async def _show_health(self, request: web.Request) -> web.Response:
        """Answer 200, or 503 with what is wrong with which sensor."""
        wrong = {choice.sensor: choice.error for choice in self._choices().values() if choice.error}
        return web.json_response({"ok": not wrong, "errors": wrong}, status=503 if wrong else 200)

    def _address(self, request: web.Request) -> tuple[str, dict[str, str]]:
        """Return the address of the sensor that is asked for, and the header that it wants.

        Raises HTTPNotFound for another one, HTTPBadGateway for one that has failed, HTTPServiceUnavailable for one that
        is being started: it will be there in a moment.
        """
        key, choices = request.match_info["key"], self._choices()
        if key not in choices:
            raise web.HTTPNotFound(text=f"there is no sensor {key!r}: choose one of {', '.join(choices)}")
        choice = choices[key]
        if choice.error and not choice.address:
            raise web.HTTPBadGateway(text=f"sensor {choice.sensor}: {choice.error}")
        if not choice.address:
            again = {"Retry-After": str(RETRY_AFTER_S)}
            raise web.HTTPServiceUnavailable(text=f"sensor {choice.sensor}: it is being started", headers=again)
        base, _, token = choice.address.partition("?token=")
        return base, {"Authorization": f"Bearer {token}"}

    async def _pass_on(self, request: web.Request) -> web.Response:
        (address, headers), query = self._address(request), request.query_string
        url = f"{address}{request.match_info['path']}" + (f"?{query}" if query else "")
        headers |= {name: request.headers[name] for name in PASSED_ON if name in request.headers}
        try:
            async with self._client.request(
                request.method, url, data=await request.read(), headers=headers, allow_redirects=False
            ) as answer:
                back = {name: answer.headers[name] for name in PASSED_BACK if name in answer.headers}
                if not request.match_info["path"].startswith(REPORTS):
                    back.pop("Content-Security-Policy", None)  # it names the address of the inner server
                return web.Response(status=answer.status, body=await answer.read(), headers=back)
        except aiohttp.ClientError as error:
            raise web.HTTPBadGateway(text=f"the dashboard of this sensor does not answer ({error})") from error

    async def _relay(self, request: web.Request) -> web.WebSocketResponse:
        """Pass frames, status and commands between a page and the dashboard of its sensor."""
        address, headers = self._address(request)
        page = web.WebSocketResponse(max_msg_size=MAX_COMMAND_BYTES, heartbeat=20.0, compress=False)
        try:
            async with self._client.ws_connect(f"{address}ws", max_msg_size=0, headers=headers) as sensor:
                await page.prepare(request)
                ways = [asyncio.create_task(_carry(page, sensor)), asyncio.create_task(_carry(sensor, page))]
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        except aiohttp.ClientError as error:
            raise web.HTTPBadGateway(text=f"the dashboard of this sensor does not answer ({error})") from error
        await page.close()
        return page


def _shown(choice: Choice) -> dict[str, object]:
    """Return what the page is told of a sensor; the address is only for this machine."""
    return {name: value for name, value in asdict(choice).items() if name != "address"}


async def _carry(source: Either, target: Either) -> None:
    """Pass messages on until one side closes."""
    with suppress(ConnectionResetError):
        async for message in source:
            if message.type is WSMsgType.BINARY:
                await target.send_bytes(message.data)
            elif message.type is WSMsgType.TEXT:
                await target.send_str(message.data)
