"""`gellight calibrate detect`: the contacts of balls in pictures, without a click."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
import typer

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.cli.calibrate.told_ball import told_ball
from gellight.cli.options import AsJson, Overwrite, check_out, with_options
from gellight.cli.showing import show
from gellight.frames.image_files import image_files, read_image
from gellight.lab.report.pictures import write_png
from gellight.lab.training.labelling import (
    Detection,
    detect,
    detect_several,
    write_overlays,
    write_presses,
)
from gellight.lab.training.labelling.plate import PlateGrid, untouched_between
from gellight.lab.training.presses import Ball
from gellight.lab.training.training import Reference, read_reference

_HEADS = {
    "center_x_px": "x", "center_y_px": "y", "contact_radius_px": "radius", "center_error_px": "+- xy",
    "radius_error_px": "+- r",
}  # fmt: skip
"""of the table, px"""


@dataclass(frozen=True)
class Pressed:
    """What is in the pictures."""

    ball_radius_mm: Annotated[float | None, typer.Option(help="radius of the pressed ball, mm")] = None
    pixel_size_mm: Annotated[float | None, typer.Option(help="mm per pixel on the gel; balls need it")] = None
    reference: Annotated[
        str | None,
        typer.Option(
            help="image of the untouched gel, or a folder of them, which is averaged; with --several it can be taken "
            "from between the balls of the first image"
        ),
    ] = None
    several: Annotated[bool, typer.Option("--several", help="look for several balls in each image")] = False
    pitch_mm: Annotated[
        float | None, typer.Option(help="distance of neighbours on a plate of balls; measures the pixel size too")
    ] = None

    @property
    def ball(self) -> Ball:
        """The ball; InputError for what is no length, or not given."""
        if self.ball_radius_mm is None or self.pixel_size_mm is None:
            raise InputError("what was pressed? give --ball-radius-mm and --pixel-size-mm")
        return told_ball(self.ball_radius_mm, self.pixel_size_mm)

    def __post_init__(self) -> None:
        """Refuse a pitch that is no length."""
        if self.pitch_mm is not None and not 0 < self.pitch_mm < np.inf:
            raise InputError(f"--pitch-mm {self.pitch_mm:g}: give a length greater than 0")

    @property
    def plate(self) -> bool:
        """Whether several balls are looked for in an image."""
        return self.several or self.pitch_mm is not None

    def untouched(self, paths: list[Path], place: Path) -> Reference:
        """Read the untouched gel, or take it from between the balls and write it to `place`; else InputError."""
        if self.reference is not None:
            return read_reference(self.reference)
        if not self.plate:
            raise InputError("one press in an image is found by what changed: give --reference, or --several balls")
        mean = np.mean([untouched_between(read_image(path), self.ball) for path in paths], axis=0)
        write_png(place, np.clip(np.rint(mean), 0, 255).astype(np.uint8))
        return read_reference(place)

    def found(self, paths: list[Path], untouched: Reference) -> tuple[list[Detection], "PlateScale | None"]:
        """Look for what was pressed, and measure the size of a pixel by the pitch of a plate where that is given."""
        if not self.plate:
            return detect(paths, untouched.image, self.ball, dots=untouched.dots), None
        found, grid = detect_several(paths, untouched.image, self.ball, dots=untouched.dots, pitch_mm=self.pitch_mm)
        return found, None if grid is None or self.pitch_mm is None else PlateScale.of(grid, self.pitch_mm)


@with_options
def command(
    images: Annotated[list[str], typer.Argument(metavar="IMAGE...", help="presses: files, folders, quoted patterns")],
    pressed: Pressed,
    out: Annotated[Path, typer.Option(help="csv to write: a row an image, as `fit` reads it")],
    overlay: Annotated[Path | None, typer.Option(help="folder for pictures with the contacts drawn in")] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Find the contact circle of each ball in pictures of presses.

    With --several and without --reference the untouched gel is taken from between the balls, and written beside the
    csv, so that `fit` can use it.
    An image without a usable press is listed with the reason and `fit` passes over it. The exit status is 0 if every
    image has its contact, 1 if some were refused, and 2 if all were, or for a wrong argument; then no file is written.
    """
    check_out(out, overwrite)
    if overlay is not None:
        check_out(overlay / "overlay", True, "--overlay")
    paths = _images(images)
    between = out.with_name(f"{out.stem}-untouched.png") if pressed.plate and pressed.reference is None else None
    if between is not None:
        check_out(between, overwrite)
    with tempfile.TemporaryDirectory(prefix="gellight-detect-") as made:
        untouched = Path(made, "untouched.png")
        found, scale = pressed.found(paths, pressed.untouched(paths, untouched))
        content = untouched.read_bytes() if between else b""
    refused = [detection for detection in found if detection.contact is None]
    if as_json:  # before what may fail
        show(_result(found, scale), as_json)
    if len(refused) < len(found):
        write_presses(out, found)
        if between is not None:
            _write(between, content)
        if overlay is not None:
            write_overlays(overlay, found)
    if not as_json:
        print(_table(found, out, scale))
    if len(refused) == len(found):
        raise InputError(f"no circle in any of {len(found)} images: nothing was written; see the reason of each")
    if refused:
        raise typer.Exit(1)


@dataclass(frozen=True, kw_only=True)
class PlateScale:
    """The size of a pixel by the pitch of a plate of balls."""

    balls: int
    pixel_size_mm: float
    across_mm_per_px: float
    down_mm_per_px: float
    miss_px: float
    """root mean square distance of the balls from their places in the grid"""

    @classmethod
    def of(cls, grid: PlateGrid, pitch_mm: float) -> Self:
        """Take it from the grid."""
        return cls(
            balls=sum(grid.on_grid),
            pixel_size_mm=round(pitch_mm / grid.pitch_px, 6),
            across_mm_per_px=round(pitch_mm / grid.across_px, 6),
            down_mm_per_px=round(pitch_mm / grid.down_px, 6),
            miss_px=round(grid.miss_px, 2),
        )


def _write(target: Path, content: bytes) -> None:
    """Write the gel between the balls; InputError where it cannot be."""
    try:
        write_file(target, content)
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror or error}): choose another place") from error


def _result(found: list[Detection], scale: PlateScale | None) -> object:
    records = [detection.record() for detection in found]
    return records if scale is None else {"circles": records, "scale": scale}


def _images(texts: list[str]) -> list[Path]:
    paths = [path for text in texts for path in image_files(text)]
    twice = {path for path in paths if paths.count(path) > 1}
    if twice:
        raise InputError(f"{min(twice)} is given twice: name each image once")
    return paths


def _table(found: list[Detection], out: Path, scale: PlateScale | None) -> str:
    seen = [detection.contact for detection in found if detection.contact is not None]
    names = list(seen[0].record()) if seen else []
    width = max(24, *(len(detection.image.name) + 1 for detection in found))
    lines = [f"{'image':<{width}}" + "".join(f"{_HEADS.get(name, name):>9}" for name in names)]
    for detection in found:
        if detection.contact is None:
            lines.append(f"{detection.image.name:<{width}}refused: {detection.refused}")
        else:
            values = detection.contact.record().values()
            lines.append(f"{detection.image.name:<{width}}" + "".join(f"{value:>9.2f}" for value in values))
    if scale is not None:
        lines.append(
            f"{scale.balls} balls of the plate: {scale.pixel_size_mm:g} mm per pixel (across "
            f"{scale.across_mm_per_px:g}, down {scale.down_mm_per_px:g}); they miss the grid by {scale.miss_px:g} px"
        )
    if seen:
        lines.append(f"wrote {out}: {len(seen)} circles, {len(found) - len(seen)} images refused")
    return "\n".join(lines)
