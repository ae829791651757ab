"""The wizard's part of the dashboard: what `calibrate.html` asks for and what it may do.

GET  /calibration                  what is to be shown, JSON (see `CalibrationState`)
GET  /calibration/report/IDENTITY  the report of a stored bundle
GET  /calibration/picture/NAME     a picture as JPEG: live, press, uniformity, coverage, verify
POST /calibration                  a command: begin, act, restore, zero; answers {} or {"message": why not}
"""

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Annotated, Literal

from aiohttp import web
from pydantic import Field, TypeAdapter, ValidationError

from gellight.base.allowed import StrictModel
from gellight.base.errors import GellightError
from gellight.daemon.calibration_service import CalibrationRequest, CalibrationService
from gellight.dashboard.commands import in_one_line
from gellight.dashboard.messages import without_nan
from gellight.dashboard.view import jpeg

logger = logging.getLogger(__name__)

REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox allow-popups"
"""a report holds its style and pictures, and no script; a bundle may come from anywhere"""
NO_CALIBRATION = "this dashboard has no calibration: start it with `gellight run` or `gellight demo`"


class Begin(StrictModel):
    """Begin a calibration."""

    type: Literal["begin"]
    request: CalibrationRequest


class Act(StrictModel):
    """Do what the routine offers; the circle is in pixels of the camera image."""

    type: Literal["act"]
    action: Literal["start", "next", "correct", "drop", "accept", "abort"]
    center_x_px: float | None = None
    center_y_px: float | None = None
    contact_radius_px: float | None = Field(default=None, gt=0)

    def arguments(self) -> dict[str, float]:
        """The numbers that were given."""
        return self.model_dump(exclude={"type", "action"}, exclude_none=True)


class Restore(StrictModel):
    """Put a stored bundle into service again."""

    type: Literal["restore"]
    identity: str = Field(pattern="^[0-9a-f]{1,16}$")


class SetZero(StrictModel):
    """Set the zero of the depth: nothing touches the gel."""

    type: Literal["zero"]


WizardCommand = Begin | Act | Restore | SetZero
COMMANDS: TypeAdapter[WizardCommand] = TypeAdapter(Annotated[WizardCommand, Field(discriminator="type")])


class Wizard:
    """The routes of the wizard."""

    def __init__(self, calibration: CalibrationService | None) -> None:
        """Let the page use `calibration`; without one every answer says so."""
        self._calibration = calibration
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
        return await self._answer(
            lambda calibration: web.json_response(without_nan(calibration.state().model_dump(mode="json"))), 500
        )

    async def _picture(self, request: web.Request) -> web.Response:
        name = request.match_info["name"]
        return await self._answer(
            lambda calibration: web.Response(body=jpeg(calibration.picture(name)), content_type="image/jpeg"), 404
        )

    async def _report(self, request: web.Request) -> web.Response:
        return await self._answer(partial(_report, request.match_info["identity"]), 404)

    async def _obey(self, request: web.Request) -> web.Response:
        # JSON only: a form of another site could be sent without asking.
        if self._calibration is not None and request.content_type != "application/json":
            return _refused("commands are application/json", 415)
        try:
            command = COMMANDS.validate_json(await request.read())
        except ValidationError as error:
            return _refused(in_one_line(error), 400)
        return await self._answer(partial(_carry_out, command), 409)

    async def _answer(self, make: Callable[[CalibrationService], web.Response], refused: int) -> web.Response:
        """Let a thread make the answer; what cannot be done is answered with the reason and the status `refused`."""
        if self._calibration is None:
            return _refused(NO_CALIBRATION, 404)
        try:
            return await asyncio.get_running_loop().run_in_executor(self._worker, make, self._calibration)
        except (GellightError, TimeoutError, ValueError) as error:
            return _refused(str(error), refused)
        except Exception:
            logger.exception("an answer of the wizard failed")
            return _refused("that failed; the log says why", 500)


def _refused(message: str, status: int) -> web.Response:
    return web.json_response({"message": message}, status=status)


def _report(identity: str, calibration: CalibrationService) -> web.Response:
    headers = {"Content-Security-Policy": REPORT_POLICY}
    return web.Response(body=calibration.report(identity), content_type="text/html", charset="utf-8", headers=headers)


def _carry_out(command: WizardCommand, calibration: CalibrationService) -> web.Response:
    match command:
        case Begin():
            calibration.begin(command.request)
        case Act():
            calibration.act(command.action, **command.arguments())
        case Restore():
            calibration.restore(command.identity)
        case SetZero():
            calibration.rezero()
    return web.json_response({})
