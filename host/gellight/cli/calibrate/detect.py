"""`gellight calibrate detect`: the contact circles of ball presses, without a click."""

import json
from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.options import AsJson, Overwrite, refuse_existing
from gellight.frames.image_files import image_files
from gellight.training.labelling import Detection, detect, write_overlays, write_presses
from gellight.training.presses import Ball
from gellight.training.training import read_reference


def command(
    images: Annotated[list[str], typer.Argument(metavar="IMAGE...", help="presses: files, folders, quoted patterns")],
    reference: Annotated[str, typer.Option(help="image of the untouched gel, or a folder of them, which is averaged")],
    ball_radius_mm: Annotated[float, typer.Option(help="radius of the pressed ball, mm")],
    pixel_size_mm: Annotated[float, typer.Option(help="mm per pixel on the gel")],
    out: Annotated[Path, typer.Option(help="csv to write: a row an image, as `fit` reads it")],
    overlay: Annotated[Path | None, typer.Option(help="folder for pictures with the circles drawn in")] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Find the contact circle of a ball press in each image.

    An image without a usable press is listed with the reason and `fit` passes over it. The exit status is 0 if every
    image has its circle, 1 if some were refused, and 2 if all were, or for a wrong argument; then no file is written.
    """
    refuse_existing(out, overwrite)
    ball = Ball(radius_mm=ball_radius_mm, pixel_size_mm=pixel_size_mm)
    untouched = read_reference(reference)
    found = detect(_images(images), untouched.image, ball, dots=untouched.dots)
    refused = [detection for detection in found if detection.circle is None]
    if len(refused) < len(found):
        write_presses(out, found)
        if overlay is not None:
            write_overlays(overlay, found)
    typer.echo(json.dumps([detection.record() for detection in found], indent=2) if as_json else _table(found, out))
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
    lines = [f"{'image':<24}{'x':>9}{'y':>9}{'radius':>9}{'quality':>9}  px"]
    for detection in found:
        circle = detection.circle
        if circle is None:
            lines.append(f"{detection.image.name:<24}refused: {detection.refused}")
        else:
            lines.append(
                f"{detection.image.name:<24}{circle.center_x_px:>9.2f}{circle.center_y_px:>9.2f}"
                f"{circle.contact_radius_px:>9.2f}{circle.quality:>9.3f}"
            )
    circles = sum(detection.circle is not None for detection in found)
    if circles:
        lines.append(f"wrote {out}: {circles} circles, {len(found) - circles} images refused")
    return "\n".join(lines)
