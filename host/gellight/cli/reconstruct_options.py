"""The options of `gellight reconstruct`, apart from its work, which takes a second to import."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError


@dataclass(frozen=True)
class Method:
    """How depth is found in the pictures."""

    calibration: Annotated[
        str | None, typer.Option(help="Bundle: a folder, a .gelcal file, or 'synthetic'; or give --lights.")
    ] = None
    lights: Annotated[
        Path | None,
        typer.Option(help="Lights that `calibrate directions` found: the images are one series, one for each light."),
    ] = None
    white: Annotated[
        float | None,
        typer.Option(min=1, help="With several lights: level that is white.", show_default="255, or 65535 of 16 bit"),
    ] = None
    least_squares: Annotated[
        bool, typer.Option("--least-squares", help="With a bundle of several lights: without its network.")
    ] = False

    def __post_init__(self) -> None:
        """Refuse both sources, and none."""
        if (self.calibration is None) == (self.lights is None):
            raise InputError("depth comes from colours or from several lights: give either --calibration or --lights")
