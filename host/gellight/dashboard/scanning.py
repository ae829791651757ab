"""The page's scan: what it may ask for, and the map. How the scan goes stands in the status.

GET  /scan/map          the map as PNG, without margins
GET  /scan/file/NAME    the map as a file: map.png, map.npz, map.ply, map.stl, map.x3p
POST /scan              a command: begin, undo, end; answers {} or {"message": why not}
"""

from typing import Annotated, Literal, Protocol

from aiohttp import web
from pydantic import Field, TypeAdapter

from gellight.base.allowed import StrictModel
from gellight.dashboard.answering import Answering

NO_SCAN = "this dashboard cannot scan: start it with `gellight run` or `gellight demo`"


class ScanDesk(Protocol):
    """What scans; what an entry point `gellight.panels` names "scan"."""

    def state(self) -> dict[str, object] | None:
        """Return all that the page shows, None before the first scan."""

    def begin(self, name: str) -> None:
        """Go on with the scan of this name, or begin one."""

    def take_back(self) -> None:
        """Take the last press back."""

    def end(self) -> None:
        """End the scan; what was pressed is kept."""

    def picture(self) -> bytes:
        """Return the map as a PNG without margins."""

    def file(self, name: str) -> bytes:
        """Return the map as a file of this name."""


class BeginScan(StrictModel):
    """Begin the scan of this name, or go on with it."""

    type: Literal["begin"]
    name: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")


class Undo(StrictModel):
    """Take the last press back."""

    type: Literal["undo"]


class EndScan(StrictModel):
    """End the scan."""

    type: Literal["end"]


ScanCommand = BeginScan | Undo | EndScan
COMMANDS: TypeAdapter[ScanCommand] = TypeAdapter(Annotated[ScanCommand, Field(discriminator="type")])


class ScanRoutes:
    """The routes of the scan."""

    def __init__(self, desk: ScanDesk | None) -> None:
        """Let the page use `desk`; without one every answer says so."""
        self._answering = Answering(desk, "scan", NO_SCAN)

    def add_routes(self, app: web.Application) -> None:
        """Add the routes to an application."""
        app.router.add_post("/scan", self._obey)
        app.router.add_get("/scan/map", self._show_map)
        app.router.add_get(r"/scan/file/{name:map\.[a-z0-9]{3}}", self._send_file)
        app.on_cleanup.append(self._answering.stop)

    async def _obey(self, request: web.Request) -> web.Response:
        return await self._answering.obey(request, COMMANDS, _carry_out)

    async def _show_map(self, request: web.Request) -> web.Response:
        return await self._answering.answer(
            lambda desk: web.Response(body=desk.picture(), content_type="image/png"), 404
        )

    async def _send_file(self, request: web.Request) -> web.Response:
        name = request.match_info["name"]
        headers = {"Content-Disposition": f'attachment; filename="{name}"'}
        return await self._answering.answer(lambda desk: web.Response(body=desk.file(name), headers=headers), 404)


def _carry_out(command: ScanCommand, desk: ScanDesk) -> None:
    match command:
        case BeginScan():
            desk.begin(command.name)
        case Undo():
            desk.take_back()
        case EndScan():
            desk.end()
