"""`gellight calibrate detect`: the contacts of balls in pictures, without a click."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.calibrate.told_ball import told_ball
from gellight.cli.options import AsJson, Overwrite, check_out, with_options
from gellight.cli.showing import show
from gellight.frames.image_files import image_files
from gellight.lab.training.labelling.detection import Detection, detect, write_overlays, write_presses
from gellight.lab.training.training import read_reference

_HEADS = {
    "center_x_px": "x", "center_y_px": "y", "contact_radius_px": "radius", "center_error_px": "+- xy",
    "radius_error_px": "+- r",
}  # fmt: skip
"""of the table, px"""


@dataclass(frozen=True)
class Pressed:
    """What is in the pictures."""

    ball_radius_mm: Annotated[float, typer.Option(help="radius of the pressed ball, mm")]
    pixel_size_mm: Annotated[float, typer.Option(help="mm per pixel on the gel")]
    reference: Annotated[str, typer.Option(help="image of the untouched gel, or a folder of them, which is averaged")]

    def found(self, paths: list[Path]) -> list[Detection]:
        """Look for what was pressed; InputError for what cannot be used."""
        untouched = read_reference(self.reference)
        return detect(paths, untouched.image, told_ball(self.ball_radius_mm, self.pixel_size_mm), dots=untouched.dots)


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

    An image without a usable press is listed with the reason and `fit` passes over it. The exit status is 0 if every
    image has its contact, 1 if some were refused, and 2 if all were, or for a wrong argument; then no file is written.
    """
    check_out(out, overwrite)
    if overlay is not None:
        check_out(overlay / "overlay", True, "--overlay")
    paths = _images(images)
    found = pressed.found(paths)
    refused = [detection for detection in found if detection.contact is None]
    if as_json:  # before what may fail
        show([detection.record() for detection in found], as_json)
    if len(refused) < len(found):
        write_presses(out, found)
        if overlay is not None:
            write_overlays(overlay, found)
    if not as_json:
        print(_table(found, out))
    if len(refused) == len(found):
        raise InputError(f"no circle in any of {len(found)} images: nothing was written; see the reason of each")
    if refused:
        raise typer.Exit(1)


def _images(texts: list[str]) -> list[Path]:
    paths = [path for text in texts for path in image_files(text)]
    twice = {path for path in paths if paths.count(path) > 1}
    if twice:
        raise InputError(f"{min(twice)} is given twice: name each image once")
    return paths


def _table(found: list[Detection], out: Path) -> str:
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
    if seen:
        lines.append(f"wrote {out}: {len(seen)} circles, {len(found) - len(seen)} images refused")
    return "\n".join(lines)
