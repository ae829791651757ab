"""The wizard's part of the dashboard: what `calibrate.html` asks for and what it may do.

GET  /calibration                  what is to be shown, JSON (see `CalibrationState`)
GET  /calibration/report/IDENTITY  the report of a stored bundle
GET  /calibration/picture/NAME     a picture as JPEG: live, press, uniformity, coverage, verify
POST /calibration                  a command: begin, act, restore, zero; answers {} or {"message": why not}
"""

from functools import partial
from typing import Annotated, Literal

from aiohttp import web
from pydantic import Field, TypeAdapter

from gellight.base.allowed import StrictModel
from gellight.daemon.calibration_service import CalibrationRequest, CalibrationService
from gellight.dashboard.answering import Answering
from gellight.dashboard.messages import without_nan
from gellight.dashboard.view import jpeg

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
        self._answering = Answering(calibration, "wizard", NO_CALIBRATION)

    def add_routes(self, app: web.Application) -> None:
        """Add the routes to an application."""
        app.router.add_get("/calibration", self._show)
        app.router.add_post("/calibration", self._obey)
        app.router.add_get("/calibration/picture/{name}", self._picture)
        app.router.add_get("/calibration/report/{identity:[0-9a-f]{16}}", self._report)
        app.on_cleanup.append(self._answering.stop)

    async def _show(self, request: web.Request) -> web.Response:
        return await self._answering.answer(
            lambda calibration: web.json_response(without_nan(calibration.state().model_dump(mode="json"))), 500
        )

    async def _picture(self, request: web.Request) -> web.Response:
        name = request.match_info["name"]
        return await self._answering.answer(
            lambda calibration: web.Response(body=jpeg(calibration.picture(name)), content_type="image/jpeg"), 404
        )

    async def _report(self, request: web.Request) -> web.Response:
        return await self._answering.answer(partial(_report, request.match_info["identity"]), 404)

    async def _obey(self, request: web.Request) -> web.Response:
        return await self._answering.obey(request, COMMANDS, _carry_out)


def _report(identity: str, calibration: CalibrationService) -> web.Response:
    headers = {"Content-Security-Policy": REPORT_POLICY}
    return web.Response(body=calibration.report(identity), content_type="text/html", charset="utf-8", headers=headers)


def _carry_out(command: WizardCommand, calibration: CalibrationService) -> None:
    match command:
        case Begin():
            calibration.begin(command.request)
        case Act():
            calibration.act(command.action, **command.arguments())
        case Restore():
            calibration.restore(command.identity)
        case SetZero():
            calibration.rezero()
