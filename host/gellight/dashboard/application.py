"""The dashboard's web application: the page, the live frames over a WebSocket, and `/command`, one of daemon/calls.py.

Flow control is by credits: the page grants as many frames as it is ready to draw, one frame is sent for each credit,
and it is always the newest. Nothing is queued, so a slow page sees fewer frames, never old ones, and slows nobody else.

Who may connect: see access.py.
"""

import asyncio
import json
import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from aiohttp import WSMsgType, web
from pydantic import Field

from gellight.base.allowed import StrictModel
from gellight.base.errors import GellightError, InputError
from gellight.daemon.calibration_service import CalibrationService
from gellight.daemon.calls import MOST_CALL, Commands, read_call, read_json
from gellight.daemon.session import SensorSession
from gellight.dashboard.access import Handler, guard
from gellight.dashboard.fetched import FOR_EVER, ScanController, add_routes, answered, refused
from gellight.dashboard.messages import encode, without_nan
from gellight.dashboard.metrics import add_metrics
from gellight.dashboard.view import ReferenceViews

logger = logging.getLogger(__name__)

PAGE = Path(__file__).parent / "page"
FRAME_TIMEOUT_S = 0.25
"""how long one wait for a frame may take; also bounds the time to stop"""
RETRY_S = 0.5  # chosen: between two looks for a sensor that gives no frame
CLOSE_S = 1.0
"""how long a page may take to say goodbye; one that reads nothing never does"""
STATUS_PERIOD_S = 0.25  # chosen: how late the page shows a new state
MAX_CREDITS = 8
"""a greedy page is not flooded"""
MOST_CREDIT_BYTES = 4096  # chosen: a credit has some 20 bytes; a longer message is a mistake or an attack
MOST_CLIENTS = 32
"""pages that are open at once: each costs messages, and more than these are a mistake or an attack"""
MOST_AT_ONCE = 16
"""commands that are being carried out, of all pages"""
COMMAND_THREADS = 4
"""so that an object can be released while others are computed"""


class Credit(StrictModel):
    """The page is ready to draw `count` more frames."""

    count: int = Field(ge=1, le=MAX_CREDITS)


@dataclass(eq=False)
class Client:
    """One open page: its credits, and whether the newest message has been sent to it."""

    socket: web.WebSocketResponse
    credits: int = 0
    sent: int = -1
    """number of the message sent last"""
    tasks: set[asyncio.Task[None]] = field(default_factory=set)
    """what is done for it: frames, status"""


class Dashboard:
    """The application: one frame pump for all clients, and one sender for each."""

    def __init__(
        self,
        source: SensorSession,
        calibration: CalibrationService | None = None,
        scan: ScanController | None = None,
        sensors: Callable[[], Mapping[str, str]] = dict,
    ) -> None:
        """Serve `source`, with the wizard and the scan where they are; nothing runs before the application starts.

        sensors: returns the names of this user's sensors, with the addresses of their pages.
        """
        self._source, self._scan, self._sensors = source, scan, sensors
        self._commands = Commands(source, calibration, scan)
        self._clients: set[Client] = set()
        self._references = ReferenceViews()
        self._calibration = calibration
        self._message = b""
        self._number = -1
        self._fresh = False
        """whether the message is known to be the newest; it is not after the pump has rested"""
        self._sequence = -1
        self._error: str | None = None
        self._changed = asyncio.Condition()
        self._waiter = ThreadPoolExecutor(1, thread_name_prefix="dashboard-frames")
        self._teller = ThreadPoolExecutor(1, thread_name_prefix="dashboard-status")
        self._worker = ThreadPoolExecutor(COMMAND_THREADS, thread_name_prefix="dashboard-commands")
        self._carrying = 0
        """commands that are being carried out"""

    def application(self, token: str) -> web.Application:
        """Return the aiohttp application: page, `/command`, `/status`, `/ws`, `/metrics`, `/health`; see fetched.py.

        token: what a request has to bring; see access.py.
        """
        app = web.Application(middlewares=[guard(token), _packed], client_max_size=MOST_CALL)
        app.router.add_get("/ws", self._serve_client)
        app.router.add_post("/command", self._obey)
        app.router.add_get("/sensors", self._list_sensors)
        app.router.add_get("/status", self._show_status)
        add_metrics(app, self._status_text)
        add_routes(app, self._source, self._references, self._calibration, self._scan)
        app.router.add_get("/", _send_page)
        app.router.add_static("/", PAGE)
        app.cleanup_ctx.append(self._run_pump)
        app.on_shutdown.append(self._close_clients)
        return app

    async def _list_sensors(self, request: web.Request) -> web.Response:
        """List the sensors of this user that have a page, for a browser on this computer: the addresses have tokens."""
        here = request.remote in ("127.0.0.1", "::1")
        return web.json_response(dict(await asyncio.to_thread(self._sensors)) if here else {})

    async def _close_clients(self, app: web.Application) -> None:
        if closing := [asyncio.create_task(client.socket.close()) for client in self._clients]:
            _, late = await asyncio.wait(closing, timeout=CLOSE_S)
            for task in late:
                task.cancel()
            await asyncio.gather(*closing, return_exceptions=True)

    async def _run_pump(self, app: web.Application):  # type: ignore[no-untyped-def]  # aiohttp's own form of a fixture
        pump = asyncio.create_task(self._pump())
        yield
        pump.cancel()
        await asyncio.gather(pump, return_exceptions=True)
        for pool in (self._waiter, self._teller, self._worker):
            pool.shutdown(wait=True, cancel_futures=True)

    async def _pump(self) -> None:
        """Fetch and encode the newest frame whenever a page is ready to draw it."""
        loop = asyncio.get_running_loop()
        while True:
            await self._wait_for_credit()
            try:
                await self._deliver(await loop.run_in_executor(self._waiter, self._next_message))
            except TimeoutError:
                await self._deliver(None)
            except Exception as error:
                self._note(error)
                await self._deliver(None)
                await asyncio.sleep(RETRY_S)
            else:
                self._error = None

    async def _wait_for_credit(self) -> None:
        async with self._changed:
            if not self._wanted():
                self._fresh = False
                await self._changed.wait_for(self._wanted)

    def _wanted(self) -> bool:
        return any(client.credits for client in self._clients)

    async def _deliver(self, message: bytes | None) -> None:
        """Hand `message` to the senders; None says that the last one still is the newest."""
        async with self._changed:
            self._fresh = True
            if message is not None:
                self._message = message
                self._number += 1
            self._changed.notify_all()

    def _note(self, error: Exception) -> None:
        text = str(error) or type(error).__name__
        if text != self._error:
            logger.log(logging.WARNING if isinstance(error, GellightError) else logging.ERROR, "no frame: %s", text)
        self._error = text

    def _next_message(self) -> bytes:
        frame = self._source.wait_frame(self._sequence, FRAME_TIMEOUT_S)
        self._sequence = frame.camera_frame.sequence
        size = self._source.pixel_size_mm
        return encode(frame, pixel_size_mm=size, references=self._references)

    async def _serve_client(self, request: web.Request) -> web.StreamResponse:
        if len(self._clients) >= MOST_CLIENTS:
            return web.Response(status=503, text=f"{MOST_CLIENTS} pages of this sensor are open: close some")
        socket = web.WebSocketResponse(max_msg_size=MOST_CREDIT_BYTES, heartbeat=20.0, compress=False)
        client = Client(socket)
        self._clients.add(client)  # before anything is awaited, so that many at once are counted
        try:
            await socket.prepare(request)
            client.tasks |= {asyncio.create_task(send(client)) for send in (self._send_frames, self._send_status)}
            await self._listen(client)
        except ConnectionResetError:
            logger.debug("a page left while it was being answered")
        finally:
            self._clients.discard(client)
            ended = [*client.tasks]
            for task in ended:
                task.cancel()
            await asyncio.gather(*ended, return_exceptions=True)
        return socket

    async def _listen(self, client: Client) -> None:
        async for message in client.socket:
            if message.type not in (WSMsgType.TEXT, WSMsgType.BINARY):
                return
            try:
                credit = read_json(Credit, message.data)
            except InputError as error:
                await client.socket.send_json({"type": "error", "message": f"no credit: {error}"})
                continue
            async with self._changed:
                client.credits = min(client.credits + credit.count, MAX_CREDITS)
                self._changed.notify_all()

    async def _send_frames(self, client: Client) -> None:
        while True:
            async with self._changed:
                await self._changed.wait_for(lambda: self._fresh and client.credits and self._number > client.sent)
                client.credits -= 1
                client.sent, message = self._number, self._message
            await client.socket.send_bytes(message)

    async def _send_status(self, client: Client) -> None:
        while True:
            await client.socket.send_str(await self._status_text())
            await asyncio.sleep(STATUS_PERIOD_S)

    async def _status_text(self) -> str:
        loop = asyncio.get_running_loop()
        return json.dumps(without_nan(await loop.run_in_executor(self._teller, self._status)), allow_nan=False)

    def _status(self) -> dict[str, object]:
        """Return the source's status, the stage and the server's clock, by which the page computes a frame's age."""
        status = dict(self._source.status())
        status["error"] = status.get("error") or self._error
        status |= {"type": "status", "now_s": time.monotonic(), "clients": len(self._clients)}
        status["calibrating"] = self._source.calibrating
        status |= {"can_scan": self._scan is not None, "scan": self._scan and self._scan.state()}
        stage = self._source.stage
        pressed = stage and {"objects": list(stage.objects), "max_depth_mm": stage.max_depth_mm, **stage.status()}
        return {**status, "stage": pressed}

    async def _show_status(self, request: web.Request) -> web.Response:
        return web.Response(text=await self._status_text(), content_type="application/json")

    async def _obey(self, request: web.Request) -> web.Response:
        """Carry out a call and answer as it says, or {"message": why not}."""
        # JSON only: a form of another site could be sent without asking.
        if request.content_type != "application/json":
            return refused("commands are application/json", 415)
        try:
            call = read_call(await request.read())
        except InputError as error:
            return refused(str(error), 400)
        if self._carrying >= MOST_AT_ONCE:
            return refused(f"{MOST_AT_ONCE} commands are being carried out: wait for them", 429)
        carry_out, kind = self._commands.take(call), call.answer_type
        self._carrying += 1
        try:
            return await answered(self._worker, lambda: web.Response(body=carry_out(), content_type=kind), 409)
        finally:
            self._carrying -= 1


async def _send_page(request: web.Request) -> web.FileResponse:
    return web.FileResponse(PAGE / "index.html")


@web.middleware
async def _packed(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Send the page's files compressed; a browser keeps the libraries, whose folders name their version."""
    response = await handler(request)
    if isinstance(response, web.FileResponse):
        known = "If-None-Match" in request.headers  # aiohttp would pack the body that a 304 has not
        if "gzip" in request.headers.get("Accept-Encoding", "") and not known:
            response.enable_compression(web.ContentCoding.gzip)
        if request.path.startswith("/vendor/"):
            response.headers["Cache-Control"] = FOR_EVER
    return response
