"""The wizard's part of the dashboard: what `calibrate.html` asks for and what it may do.

GET  /calibration                  the state of the desk, JSON
GET  /calibration/report/IDENTITY  the report of a stored bundle
GET  /calibration/picture/NAME     a picture as JPEG: live, press, uniformity, coverage, verify
POST /calibration                  a command: begin, act, restore, zero; answers {} or {"message": why not}
"""

import asyncio
import logging
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from aiohttp import web
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from gellight.base.errors import GellightError
from gellight.daemon.desk import Wishes
from gellight.dashboard.commands import Command, explain
from gellight.dashboard.messages import jpeg, without_nan

logger = logging.getLogger(__name__)

REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox allow-popups"
"""a report holds its style and pictures, and no script; a bundle may come from anywhere"""
NO_DESK = "this dashboard has no calibration: start it with `gellight run` or `gellight demo`"


class Begin(Command):
    """Begin a calibration."""

    type: Literal["begin"]
    wishes: Wishes


class Act(Command):
    """Do what the routine offers; the circle is in pixels of the camera image."""

    type: Literal["act"]
    action: Literal["start", "next", "correct", "drop", "accept", "abort"]
    center_x_px: float | None = None
    center_y_px: float | None = None
    contact_radius_px: float | None = Field(default=None, gt=0)

    def arguments(self) -> dict[str, float]:
        """The numbers that were given."""
        return self.model_dump(exclude={"type", "action"}, exclude_none=True)


class Restore(Command):
    """Put a stored bundle into service again."""

    type: Literal["restore"]
    identity: str = Field(pattern="^[0-9a-f]{1,16}$")


class SetZero(Command):
    """Set the zero of the depth: nothing touches the gel."""

    type: Literal["zero"]


WizardCommand = Begin | Act | Restore | SetZero
COMMANDS: TypeAdapter[WizardCommand] = TypeAdapter(Annotated[WizardCommand, Field(discriminator="type")])


class CalibrationDesk(Protocol):
    """What the wizard works with; `gellight.daemon.desk.Desk` is one."""

    def state(self) -> dict[str, Any]:
        """Return what is to be shown."""

    def begin(self, wishes: Wishes) -> None:
        """Begin a calibration."""

    def act(self, action: str, **arguments: float) -> None:
        """Do what the routine offers."""

    def restore(self, identity: str) -> None:
        """Put a stored bundle into service."""

    def rezero(self) -> None:
        """Set the zero of the depth."""

    def report(self, identity: str) -> bytes:
        """Return the report of a stored bundle, HTML."""

    def picture(self, name: str) -> NDArray[np.uint8]:
        """Return a picture, (H, W, 3) RGB."""


class Wizard:
    """The routes of the wizard."""

    def __init__(self, desk: CalibrationDesk | None) -> None:
        """Serve `desk`; without one every answer says so."""
        self._desk = desk
        self._worker = ThreadPoolExecutor(2, thread_name_prefix="dashboard-wizard")

    def add_routes(self, app: web.Application) -> None:
        """Add the routes to an application."""
        app.router.add_get("/calibration", self._show)
        app.router.add_post("/calibration", self._obey)
        app.router.add_get("/calibration/picture/{name}", self._picture)
        app.router.add_get("/calibration/report/{identity:[0-9a-f]{16}}", self._report)
        app.on_cleanup.append(self._stop)

    async def _stop(self, app: web.Application) -> None:
        self._worker.shutdown(wait=True, cancel_futures=True)

    async def _show(self, request: web.Request) -> web.Response:
        if self._desk is None:
            return web.json_response({"message": NO_DESK}, status=404)
        state = await asyncio.get_running_loop().run_in_executor(self._worker, self._desk.state)
        return web.json_response(without_nan(state))

    async def _picture(self, request: web.Request) -> web.Response:
        if self._desk is None:
            return web.json_response({"message": NO_DESK}, status=404)
        try:
            find = partial(self._encoded, self._desk, request.match_info["name"])
            content = await asyncio.get_running_loop().run_in_executor(self._worker, find)
        except (GellightError, TimeoutError) as error:
            return web.json_response({"message": str(error)}, status=404)
        return web.Response(body=content, content_type="image/jpeg")

    async def _report(self, request: web.Request) -> web.Response:
        if self._desk is None:
            return web.json_response({"message": NO_DESK}, status=404)
        try:
            find = partial(self._desk.report, request.match_info["identity"])
            content = await asyncio.get_running_loop().run_in_executor(self._worker, find)
        except GellightError as error:
            return web.json_response({"message": str(error)}, status=404)
        return web.Response(
            body=content, content_type="text/html", charset="utf-8", headers={"Content-Security-Policy": REPORT_POLICY}
        )

    @staticmethod
    def _encoded(desk: CalibrationDesk, name: str) -> bytes:
        return jpeg(desk.picture(name))

    async def _obey(self, request: web.Request) -> web.Response:
        # JSON only: a form of another site could be sent without asking.
        if self._desk is None or request.content_type != "application/json":
            message = NO_DESK if self._desk is None else "commands are application/json"
            return web.json_response({"message": message}, status=404 if self._desk is None else 415)
        try:
            command = COMMANDS.validate_json(await request.read())
            await asyncio.get_running_loop().run_in_executor(self._worker, self._carry_out, self._desk, command)
        except ValidationError as error:
            return web.json_response({"message": explain(error)}, status=400)
        except (GellightError, ValueError) as error:
            return web.json_response({"message": str(error)}, status=409)
        except Exception:
            logger.exception("a command of the wizard failed")
            return web.json_response({"message": "that failed; the log says why"}, status=500)
        return web.json_response({})

    @staticmethod
    def _carry_out(desk: CalibrationDesk, command: WizardCommand) -> None:
        match command:
            case Begin():
                desk.begin(command.wishes)
            case Act():
                desk.act(command.action, **command.arguments())
            case Restore():
                desk.restore(command.identity)
            case SetZero():
                desk.rezero()
