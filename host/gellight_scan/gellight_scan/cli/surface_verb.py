"""`gellight surface`: the roughness of a map of heights or of one press, and both as files for other programs."""

from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.options import AsJson, Overwrite, check_out, with_options

recording_option = partial(typer.Option, rich_help_panel="Of a recording")


class Form(StrEnum):
    """What is taken off before."""

    NONE = "none"
    PLANE = "plane"
    CURVED = "curved"


@dataclass(frozen=True)
class Measured:
    """How roughness is measured."""

    line: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(metavar="X1 Y1 X2 Y2", help="Measure along this line, mm from the middle, y down."),
    ] = None
    cutoff: Annotated[
        float | None,
        typer.Option("--cutoff-mm", help="Of the Gaussian filter.", show_default="by the waves, as ISO 4288"),
    ] = None
    form: Annotated[Form, typer.Option(help="What is taken off before; curved: also spheres and cylinders.")] = (
        Form.CURVED
    )


@dataclass(frozen=True)
class OfRecording:
    """What is taken from a recording."""

    frame: Annotated[
        int | None, recording_option(help="Its sequence number, of a recording.", show_default="the deepest")
    ] = None
    error: Annotated[
        float | None,
        recording_option(
            "--error-mm", min=0, help="Standard deviation of a height of a recording.", show_default="by the bundle"
        ),
    ] = None
    calibration: Annotated[
        str | None, recording_option(help="Bundle for a recording.", show_default="the recording's own")
    ] = None

    def refuse_useless(self) -> None:
        """Refuse options that change nothing for a map: its heights and errors are its own."""
        given = {"--frame": self.frame, "--error-mm": self.error, "--calibration": self.calibration}
        useless = [name for name, value in given.items() if value is not None]
        if useless:
            raise InputError(f"{' and '.join(useless)} is of a recording, and this is a map: remove it")


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
