"""`gellight run`: a real sensor with its dashboard, through unplugging and plugging in."""

import json
import signal
import sys
import time
from collections.abc import Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gellight.base.settings import Settings
    from gellight.daemon.daemon import Daemon

Bundle = Annotated[str | None, typer.Option(help="Calibration bundle.", show_default="synthetic")]
Port = Annotated[int | None, typer.Option(help="Port of the dashboard; 0: any free one.", show_default="8420")]
Mode = Annotated[
    str | None, typer.Option(help="How slopes are found: network, photometric or hybrid.", show_default="network")
]
Frames = Annotated[int, typer.Option(help="Stop after so many frames; 0: run until Ctrl-C.", min=0)]
STATUS_S = 1.0
WAIT_S = 0.5


def command(
    sensor: Annotated[
        str | None,
        typer.Option(help="auto, sensor://NAME, v4l2:///dev/..., sim://", show_default="auto, or the settings"),
    ] = None,
    calibration: Bundle = None,
    port: Port = None,
    mode: Mode = None,
    dashboard: Annotated[bool, typer.Option(help="Serve the dashboard.")] = True,
    frames: Frames = 0,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the status as JSON: every second, or once after --frames.")
    ] = False,
) -> None:
    """Stream depth from a sensor; while it is unplugged, go on serving the status and look for it."""
    from gellight.daemon.assembly import open_session

    settings = settings_of(sensor, calibration, 0 if frames and port is None else port, mode)
    # a termination has to make the LEDs dark too
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    with open_session(settings) as daemon, served(daemon, settings, dashboard):
        warn_of_foreign_bundle(settings)
        try:
            summary = follow(daemon, frames, as_json)
        except KeyboardInterrupt:
            return
    print(json.dumps(summary) if as_json else "\n".join(f"{name:16} {value}" for name, value in summary.items()))


def settings_of(sensor: str | None, calibration: str | None, port: int | None, mode: str | None = None) -> "Settings":
    """Return the settings; where none of them names a sensor it is the one that is plugged in, not a simulated one."""
    from gellight.base.settings import load_settings, read_layers

    flags = {"sensor.url": sensor, "sensor.calibration": calibration, "dashboard.port": port}
    flags["reconstruction.mode"] = mode
    if not any("url" in layer.values.get("sensor", {}) for layer in read_layers(flags)):
        flags["sensor.url"] = "auto"
    return load_settings(flags)


def warn_of_foreign_bundle(settings: "Settings") -> None:
    """Say so where another sensor than that of the paper, simulated, is used with the bundle of that one."""
    from gellight.bundle.bundle import SYNTHETIC

    changed = ", ".join(settings.geometry.overrides())
    if settings.sensor.calibration != SYNTHETIC:
        return
    if settings.sensor.url.startswith(("auto", "sensor://", "v4l2://")):
        print("gellight: the bundle `synthetic` is of the simulated sensor: calibrate yours before you trust its depth",
              file=sys.stderr)  # fmt: skip
    elif settings.sensor.url.startswith("sim://") and changed:
        print(f"gellight: the bundle `synthetic` is of the paper's sensor, the settings change its {changed}: make one "
              "with `gellight calibrate --auto` before you trust the depth", file=sys.stderr)  # fmt: skip


@contextmanager
def served(daemon: "Daemon", settings: "Settings", wanted: bool) -> "Iterator[None]":
    """Serve the dashboard, if wanted."""
    if not wanted:
        yield
        return
    from gellight.daemon.calibration_service import CalibrationService
    from gellight.dashboard.server import DashboardServer

    with (
        CalibrationService(daemon, led_colours=settings.geometry.led_colours) as service,
        DashboardServer(daemon, port=settings.dashboard.port, calibration=service) as server,
    ):
        print(f"dashboard: {server.url}   (Ctrl-C stops)", file=sys.stderr, flush=True)
        yield


def follow(daemon: "Daemon", frames: int, as_json: bool) -> dict[str, object]:
    """Follow the tactile frames until `frames` came (0: for ever), telling the status; return it at the end.

    A sensor that is away is waited for. Raises what ends the run.
    """
    from gellight.frames.camera import EndOfStream

    count, sequence, deepest, told_s = 0, -1, 0.0, 0.0
    started_s = time.monotonic()
    while not frames or count < frames:
        try:
            frame = daemon.wait_frame(sequence, WAIT_S)
        except EndOfStream:
            break
        except TimeoutError:
            pass
        else:
            sequence, count = frame.camera_frame.sequence, count + 1
            deepest = max(deepest, frame.contact.indentation_mm)
        if time.monotonic() - told_s >= STATUS_S:
            told_s = time.monotonic()
            tell(daemon.status(), as_json and not frames)
    fps = round(count / (time.monotonic() - started_s), 2)
    return {**daemon.status(), "frames": count, "fps": fps, "indentation_mm": round(deepest, 4)}


def tell(status: Mapping[str, object], as_json: bool) -> None:
    """Print the status: JSON to standard output, or one line for people where somebody looks."""
    if as_json:
        print(json.dumps(status), flush=True)
    elif status["error"]:
        print(f"gellight: {status['error']}", file=sys.stderr, flush=True)
    elif sys.stderr.isatty():
        print(f"\r{status['frames']} frames, {status['fps']} frames/s, age {status['frame_age_ms']} ms, "
              f"{status['lost']} lost", end="", file=sys.stderr, flush=True)  # fmt: skip
