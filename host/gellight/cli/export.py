"""`gellight export`: a recording as files that other programs read."""

from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.options import AsJson, rare_option
from gellight.recording.kinds import ONE_FILE, Kind


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of `gellight record`.")],
    out: Annotated[Path, typer.Option(help="Folder for the files; created if need be.")],
    kind: Annotated[Kind, typer.Option("--as", help="A file a frame, a video, arrays or a data set.")] = Kind.NPZ,
    calibration: Annotated[str | None, typer.Option(help="Bundle.", show_default="the recording's own")] = None,
    every: Annotated[int, typer.Option(min=1, help="Take every n-th frame.")] = 1,
    depth_scale_um: Annotated[float, rare_option(min=1, help="Depth of the brightest colour, micrometres.")] = 1000,
    track: Annotated[bool, typer.Option("--track", help="Follow the object: hdf5 and lerobot get its pose.")] = False,
    as_json: AsJson = False,
) -> None:
    """Turn a recording into arrays, pictures or a video.

    Depth is computed from the recorded pictures. A file is named after the sequence number of its frame; .npz files
    have what those of `gellight reconstruct` have, .ply files are surfaces in mm.
    """
    from gellight.cli.running.export import export  # not for the help

    if track and kind not in ONE_FILE:
        raise InputError(f"--track: --as {kind} has no place for a pose: take one of {', '.join(ONE_FILE)}")
    export(file, out, kind, calibration, every=every, scale_um=depth_scale_um, track=track, as_json=as_json)
