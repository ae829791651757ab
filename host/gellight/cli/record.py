"""`gellight record`: what a sensor gives, in a file."""

from pathlib import Path
from typing import Annotated

import typer

from gellight.base.settings import load_settings
from gellight.cli.options import AsJson, RunOptions, Seconds, check_out, rare_option, with_options
from gellight.frames.measures import MapOnRequest
from gellight.recording.kinds import DepthKind


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
        rare_option("--map", help="Record this map too; give it again for another one.", show_default="none"),
    ] = None,
    dashboard: Annotated[bool, rare_option(help="Serve the dashboard.")] = False,
    as_json: AsJson = False,
) -> None:
    """Record what a sensor gives, in an MCAP file.

    ROS 2 tools open it too. It has the camera's own bytes, times and light of each frame, and the calibration bundle.
    It ends, whole, at Ctrl-C, after --seconds or --frames, and before the disk is full.
    """
    from gellight.cli.running.record import record  # not for the help

    check_out(out, None)
    settings = load_settings({"sensor.url": sensor, **options.flags()})
    record(settings, out, depth=depth, maps=maps or (), frames=options.frames, seconds=seconds,
           dashboard=dashboard, as_json=as_json)  # fmt: skip
