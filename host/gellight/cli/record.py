"""`gellight record`: what a sensor gives, in a file."""

import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from gellight.base import logs
from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.cli.ending import until_interrupted
from gellight.cli.one_sensor import WAIT_S, RunOptions, opened
from gellight.cli.options import AsJson, Seconds, check_out, with_options
from gellight.cli.showing import show
from gellight.daemon.session import SensorSession
from gellight.frames.camera import EndOfStream
from gellight.frames.measures import MapOnRequest
from gellight.recording.recording_file import DepthKind
from gellight.stream.recorder import Recorder, RecordingStatus

STATUS_S = 1.0


@with_options
def command(
    options: RunOptions,
    out: Annotated[Path, typer.Option(help="File to write, NAME.mcap; it must not exist.")],
    sensor: Annotated[
        str | None, typer.Option(help="As `gellight run` has it.", show_default="auto, or the settings")
    ] = None,
    seconds: Seconds = 0.0,
    depth: Annotated[DepthKind, typer.Option(help="Record depth too; else it is computed from the pictures.")] = (
        DepthKind.NONE
    ),
    maps: Annotated[
        list[MapOnRequest] | None,
        typer.Option("--map", help="Record this map too; give it again for another one.", show_default="none"),
    ] = None,
    dashboard: Annotated[bool, typer.Option(help="Serve the dashboard.")] = False,
    as_json: AsJson = False,
) -> None:
    """Record what a sensor gives in a file that ROS 2 tools open too.

    The file has the camera's own bytes, times and light of each frame, and the calibration bundle. It ends, whole, at
    Ctrl-C, after --seconds or --frames, and before the disk is full.
    """
    check_out(out, None)
    settings = load_settings({"sensor.url": sensor, **options.flags()})
    with opened(settings, dashboard=dashboard) as (daemon, _):
        recorder = Recorder(daemon, out, name=settings.stream.name, depth=depth, maps=maps or (), frames=options.frames)
        if not daemon.camera.waits:  # of a file every frame is recorded
            logs.say(f"recording: about {recorder.bytes_a_minute() / 1e6:.0f} MB a minute")
        with recorder, until_interrupted(not (seconds or options.frames)):
            follow(daemon, recorder, options.frames, seconds)
        show({"file": str(out), **asdict(recorder.status)}, as_json, said(out, recorder.status))
    if recorder.ended:
        raise InputError(recorder.status.ended)


def follow(daemon: SensorSession, recorder: Recorder, frames: int, seconds: float) -> None:
    """Wait until this number of frames or seconds is recorded (0: for ever), or until there is no more to record."""
    begun_s = shown_s = time.monotonic()
    sequence = -1
    while not recorder.ended and not (frames and recorder.status.frames >= frames):
        now_s = time.monotonic()
        if seconds and now_s - begun_s >= seconds:
            return
        try:
            sequence = daemon.next_frame(sequence, WAIT_S).camera_frame.sequence
        except EndOfStream:
            return
        except TimeoutError:
            continue
        if sys.stderr.isatty() and now_s - shown_s >= STATUS_S:
            shown_s = now_s
            print(f"\r{said(recorder.path, recorder.status)}", end="", file=sys.stderr, flush=True)


def said(out: Path, status: RecordingStatus) -> str:
    """Return how far a recording is, for people."""
    left = f", room for {status.left_s / 60:.0f} min" if status.left_s is not None else ""
    return f"{out}: {status.frames} frames, {status.size_bytes / 1e6:.1f} MB, {status.lost} lost{left}"
