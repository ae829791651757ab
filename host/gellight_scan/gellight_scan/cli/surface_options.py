"""The options of `gellight surface`, apart from its work, which takes a second to import."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import typer

from gellight.base.errors import InputError


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
        int | None, typer.Option(help="Its sequence number, of a recording.", show_default="the deepest")
    ] = None
    error: Annotated[
        float | None,
        typer.Option(
            "--error-mm", min=0, help="Standard deviation of a height of a recording.", show_default="by the bundle"
        ),
    ] = None
    calibration: Annotated[
        str | None, typer.Option(help="Bundle for a recording.", show_default="the recording's own")
    ] = None

    def refuse_useless(self) -> None:
        """Refuse options that change nothing for a map: its heights and errors are its own."""
        given = {"--frame": self.frame, "--error-mm": self.error, "--calibration": self.calibration}
        useless = [name for name, value in given.items() if value is not None]
        if useless:
            raise InputError(f"{' and '.join(useless)} is of a recording, and this is a map: remove it")
