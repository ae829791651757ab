"""The dashboard's web application: the page, the live frames over a WebSocket, and the presses of a visitor.

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
from pydantic import ValidationError

from gellight.base.allowed import in_words
from gellight.base.errors import GellightError, InputError
from gellight.daemon.calibration_service import CalibrationService
from gellight.daemon.session import SensorSession
from gellight.dashboard.access import guard
from gellight.dashboard.commands import COMMANDS, Credit, Press, Release, Track
from gellight.dashboard.messages import MadeOnce, encode, without_nan
from gellight.dashboard.metrics import Metrics
from gellight.dashboard.page_files import FOR_EVER, PageFiles
from gellight.dashboard.scanning import ScanDesk, ScanRoutes
from gellight.dashboard.view import ReferenceViews
from gellight.dashboard.wizard import Wizard

logger = logging.getLogger(__name__)

PAGE = Path(__file__).parent / "page"
FRAME_TIMEOUT_S = 0.25
"""how long one wait for a frame may take; also bounds the time to stop"""
RETRY_S = 0.5
CLOSE_S = 1.0
"""how long a page may take to say goodbye; one that reads nothing never does"""
STATUS_PERIOD_S = 0.25
MAX_CREDITS = 8
"""a greedy page is not flooded"""
MAX_COMMAND_BYTES = 4096
MOST_CLIENTS = 32
"""pages that are open at once: each costs messages, and more than these are a mistake or an attack"""
MOST_AT_ONCE = 16
"""commands of a page that are being carried out"""
STAGE_THREADS = 2
"""so that an object can be released while another is computed"""
CALIBRATING = "a calibration is running, and only its own presses may touch the gel: finish or stop it in the wizard"


@dataclass(eq=False)
class Client:
    """One open page: its credits, and whether the newest message has been sent to it."""

    socket: web.WebSocketResponse
    credits: int = 0
    sent: int = -1
    """number of the message sent last"""
    tasks: set[asyncio.Task[None]] = field(default_factory=set)
    """what is done for it: frames, status, commands"""


class Dashboard:
    """The application: one frame pump for all clients, and one sender for each."""

    def __init__(
        self,
        source: SensorSession,
        calibration: CalibrationService | None = None,
        scan: ScanDesk | None = None,
        sensors: Callable[[], Mapping[str, str]] = dict,
    ) -> None:
        """Serve `source`, with the wizard and the scan where they are; nothing runs before the application starts.

        sensors: returns the names of this user's sensors, with the addresses of their pages.
        """
        self._source, self._calibration, self._scan, self._sensors = source, calibration, scan, sensors
        self._wizard = Wizard(calibration)
        self._clients: set[Client] = set()
        self._references, self._once = ReferenceViews(), MadeOnce()
        self._message = b""
        self._number = -1
        self._fresh = False
        """whether the message is known to be the newest; it is not after the pump has rested"""
        self._sequence = -1
        self._image_shape: tuple[int, int] | None = None
        self._error: str | None = None
        self._changed = asyncio.Condition()
        self._waiter = ThreadPoolExecutor(1, thread_name_prefix="dashboard-frames")
        self._teller = ThreadPoolExecutor(1, thread_name_prefix="dashboard-status")
        self._worker = ThreadPoolExecutor(STAGE_THREADS, thread_name_prefix="dashboard-commands")
        self._newest_command = -1

    def application(self, token: str) -> web.Application:
        """Return the aiohttp application: page, `/status`, `/ws`, `/metrics`, `/health`, and the wizard's.

        token: what a request has to bring; see access.py.
        """
        app = web.Application(middlewares=[guard(token)])
        app.router.add_get("/ws", self._serve_client)
        app.router.add_get("/sensors", self._list_sensors)
        app.router.add_get("/status", self._show_status)
        Metrics(self._status_text).add_routes(app)
        self._wizard.add_routes(app)
        ScanRoutes(self._scan).add_routes(app)
        app.router.add_get("/reference/{name}", self._show_reference)
        PageFiles(PAGE).add_routes(app)
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
        self._waiter.shutdown(wait=True, cancel_futures=True)
        self._teller.shutdown(wait=True, cancel_futures=True)
        self._worker.shutdown(wait=True, cancel_futures=True)

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
        height, width = frame.depth_mm.shape
        self._image_shape = (height, width)
        size = self._source.pixel_size_mm
        return encode(frame, pixel_size_mm=size, references=self._references, once=self._once)

    async def _serve_client(self, request: web.Request) -> web.StreamResponse:
        if len(self._clients) >= MOST_CLIENTS:
            return web.Response(status=503, text=f"{MOST_CLIENTS} pages of this sensor are open: close some")
        socket = web.WebSocketResponse(max_msg_size=MAX_COMMAND_BYTES, heartbeat=20.0, compress=False)
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
            if message.type is WSMsgType.TEXT:
                await self._obey(client, message.data)
            elif message.type is WSMsgType.BINARY:
                await _answer_error(client, None, "commands are JSON text, not binary")

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
        status["calibrating"] = self._calibrating
        status |= {"can_scan": self._scan is not None, "scan": self._scan and self._scan.state()}
        stage = self._source.stage
        pressed = stage and {"objects": list(stage.objects), "max_depth_mm": stage.max_depth_mm, **stage.status()}
        return {**status, "stage": pressed}

    async def _show_status(self, request: web.Request) -> web.Response:
        return web.Response(text=await self._status_text(), content_type="application/json")

    async def _show_reference(self, request: web.Request) -> web.Response:
        try:
            picture = self._references.picture(request.match_info["name"])
        except InputError as error:
            return web.Response(status=404, text=str(error))
        return web.Response(body=picture, content_type="image/webp", headers={"Cache-Control": FOR_EVER})

    async def _obey(self, client: Client, text: str) -> None:
        try:
            command = COMMANDS.validate_json(text)
        except ValidationError as error:
            await _answer_error(client, None, in_words(error, "the command"))
            return
        if isinstance(command, Credit):
            async with self._changed:
                client.credits = min(client.credits + command.count, MAX_CREDITS)
                self._changed.notify_all()
            return
        if len(client.tasks) >= MOST_AT_ONCE:
            await _answer_error(client, command.type, f"{MOST_AT_ONCE} commands are being carried out: wait for them")
            return
        self._newest_command += 1
        task = asyncio.create_task(self._carry_out(client, command, self._newest_command))
        client.tasks.add(task)
        task.add_done_callback(client.tasks.discard)

    async def _carry_out(self, client: Client, command: Press | Release | Track, number: int) -> None:
        try:
            await asyncio.get_running_loop().run_in_executor(self._worker, self._move_stage, command, number)
        except (GellightError, ValueError) as error:
            await _answer_error(client, command.type, str(error))
        except Exception:
            logger.exception("%s failed", command)
            await _answer_error(client, command.type, "the stage failed; its log says why")
        else:
            await client.socket.send_json({"type": "done", "command": command.type})

    @property
    def _calibrating(self) -> bool:
        return self._calibration is not None and self._calibration.calibrating

    def _move_stage(self, command: Press | Release | Track, number: int) -> None:
        """Do what a page asks for; a press is dropped when a newer command has come before it was computed."""
        stage = self._source.stage
        if isinstance(command, Track):
            self._source.track(command.on)
            if stage is not None and not self._calibrating:
                stage.drive(on=command.on)
            return
        if stage is None:
            raise ValueError("this sensor has no stage: objects can be pressed on a simulated sensor only (sim://)")
        if self._calibrating:
            raise ValueError(CALIBRATING)
        if isinstance(command, Release):
            stage.release()
            return
        command.check(stage, self._view_mm())
        press = command.object, command.depth_mm, command.x_mm, command.y_mm
        if number == self._newest_command:
            stage.prepare(*press)
        if number == self._newest_command and not self._calibrating:
            stage.press(*press)

    def _view_mm(self) -> tuple[float, float]:
        if self._image_shape is None:
            raise ValueError("no frame has been seen yet, so the size of the view is unknown: wait for the first frame")
        pixel_x, pixel_y = self._source.pixel_size_mm
        return self._image_shape[1] * pixel_x, self._image_shape[0] * pixel_y


async def _answer_error(client: Client, command: str | None, message: str) -> None:
    await client.socket.send_json({"type": "error", "command": command, "message": message})
