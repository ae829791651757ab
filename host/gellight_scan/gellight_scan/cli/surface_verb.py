"""`gellight surface`: the roughness of a map of heights or of one press, and both as files for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from gellight.cli.options import AsJson, Overwrite, check_out, with_options
from gellight_scan.cli.surface_options import Measured, OfRecording


@with_options
def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A map of heights (.npz), or a recording (.mcap).")],
    measured: Measured,
    recorded: OfRecording,
    out: Annotated[
        list[Path] | None,
        typer.Option(help="Write the map here, and measure nothing: .png, .x3p, .ply, .stl, .npz; repeatable."),
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Measure the roughness of a surface, or export it.

    Over the whole map: Sa, Sq, Sz, Ssk and Sku (ISO 25178-2); along a line: Ra, Rq and Rz (ISO 21920-2); all by the
    Gaussian filter of ISO 16610. Of a recording it is what one press felt. What is finer than the coating's blur and
    the pixels allow, lies within the errors, or was not reached by the gel is refused. Lengths are in mm.
    """
    from gellight_scan.cli.measuring import surface  # not for the help

    for path in out or ():
        check_out(path, overwrite)
    surface(file, measured, recorded, out or (), as_json)
