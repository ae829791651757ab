"""What a sensor gives, in a file."""

import sys
import time
from collections.abc import Collection
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from gellight.base import logs
from gellight.base.errors import InputError
from gellight.base.settings import Settings
from gellight.cli.ending import until_interrupted
from gellight.cli.one_sensor import STATUS_S, frames_of, opened
from gellight.cli.showing import show
from gellight.daemon.session import SensorSession
from gellight.frames.camera import EndOfStream
from gellight.frames.measures import MapOnRequest
from gellight.recording.kinds import DepthKind
from gellight.stream.recorder import Recorder, RecordingStatus


def record(
    settings: Settings,
    out: Path,
    *,
    depth: DepthKind,
    maps: Collection[MapOnRequest],
    frames: int,
    seconds: float,
    dashboard: bool,
    as_json: bool,
) -> None:
    """Record this number of frames or seconds (0: for ever) in the file `out`, and show what was recorded."""
    with opened(settings, dashboard=dashboard) as (daemon, _):
        recorder = Recorder(daemon, out, name=settings.stream.name, depth=depth, maps=maps, frames=frames)
        with recorder, until_interrupted(not (seconds or frames)):
            begun_s = time.monotonic()
            if not daemon.camera.waits:  # of a file every frame is recorded
                with suppress(TimeoutError, EndOfStream):  # of a slow sensor it is not known
                    logs.say(f"recording: about {recorder.bytes_a_minute() / 1e6:.0f} MB a minute")
            follow(daemon, recorder, frames, seconds and begun_s + seconds)
        if not recorder.status.frames:
            out.unlink()
            raise InputError(f"no frame came, so there is no {out}: see what `gellight doctor` says of the sensor")
        show({"file": str(out), **asdict(recorder.status)}, as_json, said(out, recorder.status))
    if recorder.ended:
        raise InputError(recorder.status.ended)


def follow(daemon: SensorSession, recorder: Recorder, frames: int, until_s: float) -> None:
    """Wait until so many frames are recorded or this time has come (0: for ever), or there is no more to record."""
    shown_s = time.monotonic()
    for frame in frames_of(daemon):
        now_s, enough = time.monotonic(), frames and recorder.status.frames >= frames
        if recorder.ended or enough or (until_s and now_s >= until_s):
            return
        if frame is not None and sys.stderr.isatty() and now_s - shown_s >= STATUS_S:
            shown_s = now_s
            print(f"\r{said(recorder.path, recorder.status)}", end="", file=sys.stderr, flush=True)


def said(out: Path, status: RecordingStatus) -> str:
    """Return how far a recording is, for people."""
    left = f", room for {status.left_s / 60:.0f} min" if status.left_s is not None else ""
    return f"{out}: {status.frames} frames, {status.size_bytes / 1e6:.1f} MB, {status.lost} lost{left}"
