"""What the page fetches beside its frames: the newest frame as a file, the calibration, the scan.

GET  /frame/KIND                   the newest frame at full size: npz, ply
GET  /reference/NAME               a reference image, WebP; see reference_views.py
GET  /calibration                  what the wizard shows, JSON (see `CalibrationState`)
GET  /calibration/report/IDENTITY  the report of a stored bundle
GET  /calibration/picture/NAME     a picture as JPEG: live, untouched, press, coverage, verify
GET  /scan/map                     the map as PNG, without margins
GET  /scan/file/NAME               the map as a file: map.png, map.npz, map.ply, map.stl, map.x3p
"""

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

from aiohttp import web

from gellight.base.errors import GellightError
from gellight.daemon.calibration_service import CalibrationService
from gellight.daemon.calls import Scanning
from gellight.daemon.session import SensorSession
from gellight.dashboard.messages import without_nan
from gellight.dashboard.view import ReferenceViews, jpeg
from gellight.frames.point_cloud import ply
from gellight.recording.array_files import maps_file

logger = logging.getLogger(__name__)
FOR_EVER = "public, max-age=31536000, immutable"
"""for what never changes under its name"""
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox allow-popups"
"""a report holds its style and pictures, and no script; a bundle may come from anywhere"""
NO_CALIBRATION = "this dashboard has no calibration: start it with `gellight run` or `gellight demo`"
NO_SCAN = "this dashboard cannot scan: start it with `gellight run` or `gellight demo`"
FRAME_S = 2.0  # chosen: a download without a frame is refused after that


class ScanController(Scanning, Protocol):
    """What scans; what an entry point `gellight.panels` names "scan"."""

    def state(self) -> dict[str, object] | None:
        """Return all that the page shows, None before the first scan."""

    def picture(self) -> bytes:
        """Return the map as a PNG without margins."""

    def file(self, name: str) -> bytes:
        """Return the map as a file of this name."""


def add_routes(
    app: web.Application,
    source: SensorSession,
    references: ReferenceViews,
    calibration: CalibrationService | None,
    scan: ScanController | None,
) -> None:
    """Add the routes to an application; where there is no calibration or no scan, the answer says so."""
    worker = ThreadPoolExecutor(2, thread_name_prefix="dashboard-fetched")

    def add(
        path: str, about: object, make: Callable[..., web.Response], missing: str = "", *, status: int = 404
    ) -> None:
        """Let a thread `make` the answer of what is asked `about` and the parts of the path that have names.

        What cannot be had is answered with the reason and `status`.
        """

        async def answer(request: web.Request) -> web.Response:
            if about is None:
                return refused(missing, 404)
            return await answered(worker, lambda: make(about, *request.match_info.values()), status)

        app.router.add_get(path, answer)

    async def stop(app: web.Application) -> None:
        worker.shutdown(wait=True, cancel_futures=True)

    add("/frame/{kind:npz|ply}", source, _frame_file, status=503)
    add("/reference/{name}", references, _reference)
    add("/calibration", calibration, _state, NO_CALIBRATION, status=500)
    add("/calibration/picture/{name}", calibration, _picture, NO_CALIBRATION)
    add("/calibration/report/{identity:[0-9a-f]{16}}", calibration, _report, NO_CALIBRATION)
    add("/scan/map", scan, _map, NO_SCAN)
    add(r"/scan/file/{name:map\.[a-z0-9]{3}}", scan, _map_file, NO_SCAN)
    app.on_cleanup.append(stop)


def _reference(known: ReferenceViews, name: str) -> web.Response:
    return web.Response(body=known.picture(name), content_type="image/webp", headers={"Cache-Control": FOR_EVER})


def _state(calibration: CalibrationService) -> web.Response:
    return web.json_response(without_nan(calibration.state().model_dump(mode="json")))


def _picture(calibration: CalibrationService, name: str) -> web.Response:
    return web.Response(body=jpeg(calibration.picture(name)), content_type="image/jpeg")


def _report(calibration: CalibrationService, identity: str) -> web.Response:
    content, headers = calibration.report(identity), {"Content-Security-Policy": REPORT_POLICY}
    return web.Response(body=content, content_type="text/html", charset="utf-8", headers=headers)


def _map(scan: ScanController) -> web.Response:
    return web.Response(body=scan.picture(), content_type="image/png")


def _map_file(scan: ScanController, name: str) -> web.Response:
    return _file(scan.file(name), name)


async def answered(worker: ThreadPoolExecutor, make: Callable[[], web.Response], status: int) -> web.Response:
    """Let a thread make an answer; what is refused is answered with the reason and `status`."""
    try:
        return await asyncio.get_running_loop().run_in_executor(worker, make)
    except (GellightError, TimeoutError, ValueError) as error:
        return refused(str(error), status)
    except Exception:
        logger.exception("an answer failed")
        return refused("internal error; see the log of the sensor's program", 500)


def refused(message: str, status: int) -> web.Response:
    """Return the answer that says why not."""
    return web.json_response({"message": message}, status=status)


def _file(content: bytes, name: str) -> web.Response:
    return web.Response(body=content, headers={"Content-Disposition": f'attachment; filename="{name}"'})


def _frame_file(source: SensorSession, kind: str) -> web.Response:
    """Return the newest frame as a file; TimeoutError where there is none."""
    frame = source.wait_frame(-1, FRAME_S)
    if kind == "npz":
        content = maps_file(frame, frame.provenance.findings if frame.provenance else ())
    else:
        height_mm = frame.provenance.camera_height_mm if frame.provenance else 0.0
        content = ply(frame.depth_mm, source.pixel_size_mm, frame.camera_frame.image, height_mm)
    return _file(content, f"gellight-{frame.camera_frame.sequence}.{kind}")
