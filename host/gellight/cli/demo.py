"""`gellight demo`: the whole sensor, simulated, with its dashboard."""

import json
import sys
import time
from typing import TYPE_CHECKING, Annotated

import typer

from gellight.cli.run import Bundle, Frames, Mode, Port, warn_of_foreign_bundle

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gellight.daemon.daemon import Daemon
    from gellight.frames.frames import TactileFrame

FRAME_TIMEOUT_S = 20.0


def command(
    sensor: Annotated[str | None, typer.Option(help="URL of the camera.", show_default="sim://")] = None,
    calibration: Bundle = None,
    port: Port = None,
    mode: Mode = None,
    browser: Annotated[bool, typer.Option(help="Open the dashboard in a browser.")] = True,
    frames: Frames = 0,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the statistics as one JSON object at the end.")
    ] = False,
) -> None:
    """Press objects into a simulated sensor and see what it feels."""
    from gellight.base.settings import load_settings
    from gellight.daemon.assembly import open_session
    from gellight.daemon.calibration_service import CalibrationService
    from gellight.dashboard.server import DashboardServer

    # A bounded run is for programs, several of which may run at once: it takes any free port unless told.
    flags = {"sensor.url": sensor, "sensor.calibration": calibration, "dashboard.port": port}
    flags["reconstruction.mode"] = mode
    settings = load_settings({**flags, "dashboard.port": 0} if frames and port is None else flags)
    with (
        open_session(settings) as daemon,
        CalibrationService(daemon, led_colours=settings.geometry.led_colours) as service,
        DashboardServer(daemon, port=settings.dashboard.port, calibration=service) as server,
    ):
        print(f"dashboard: {server.url}   (Ctrl-C stops)", file=sys.stderr, flush=True)
        warn_of_foreign_bundle(settings)
        if browser and not frames:
            open_browser(server.url)
        try:
            summary = watch(daemon, frames)
        except KeyboardInterrupt:
            return
    print(json.dumps(summary) if as_json else table(summary))


def watch(daemon: "Daemon", frames: int) -> dict[str, object]:
    """Follow the tactile frames until `frames` came (0: for ever); return the statistics of the run."""
    count, deepest = 0, 0.0
    started_s = time.monotonic()
    for frame in followed(daemon):
        count += 1
        deepest = max(deepest, frame.contact.indentation_mm)
        if count == frames:
            daemon.check(frame)  # a short run may end before the first check that runs beside it
            break
    return {
        **daemon.status(),
        "frames": count,
        "fps": round(count / (time.monotonic() - started_s), 2),
        "indentation_mm": round(deepest, 4),
    }


def followed(daemon: "Daemon") -> "Iterator[TactileFrame]":
    """Yield every frame that is not overtaken, until the images of a folder are used up.

    Raises CameraError when the camera falls silent.
    """
    from gellight.base.errors import CameraError
    from gellight.frames.camera import EndOfStream

    sequence = -1
    while True:
        try:
            frame = daemon.wait_frame(sequence, FRAME_TIMEOUT_S)
        except EndOfStream:
            return
        except TimeoutError:
            raise CameraError(f"no frame for {FRAME_TIMEOUT_S:g} s: check the camera and start again") from None
        sequence = frame.camera_frame.sequence
        yield frame


def table(summary: dict[str, object]) -> str:
    """Return the statistics as lines for people."""
    return "\n".join(f"{name:16} {value}" for name, value in summary.items())


def open_browser(url: str) -> None:
    """Open `url` where there is a screen; a terminal browser would only take the terminal away."""
    import os
    import webbrowser

    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(url)
