"""`gellight calibrate view`: take perspective and surroundings out of the pictures of a camera."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.cli.options import AsJson, Overwrite, rare_option, with_options
from gellight.cli.showing import show
from gellight.frames.image_files import image_files, read_image, read_levels
from gellight.frames.view import View
from gellight.lab.optics.lens.lattice import view_of_grid
from gellight.lab.report.pictures import encode_png

VIEW = "view.json"

grid_option = partial(typer.Option, rich_help_panel="From a grid")


@dataclass(frozen=True)
class Chosen:
    """Which part of the pictures is the view."""

    corners: Annotated[
        str | None,
        typer.Option(help="x,y of top left, top right, bottom right, bottom left, separated by spaces; with --size"),
    ] = None
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT of the view, px")] = None
    crop: Annotated[str | None, typer.Option(help="x,y,width,height: this part as it is")] = None
    grid: Annotated[
        Path | None, grid_option(help="picture of a square grid on the gel; with --pixel-size-mm and these")
    ] = None
    spacing_px: Annotated[float | None, grid_option(help="distance of neighbours in it, roughly")] = None
    pitch_mm: Annotated[float | None, grid_option(help="the same in mm")] = None
    pixel_size_mm: Annotated[float | None, typer.Option(help="mm per pixel that the view is to have")] = None

    def view(self, first: Path) -> View:
        """Return the view of pictures like the `first`; InputError where the options do not say one."""
        image = read_image(self.grid or first)
        taken_shape = (image.shape[0], image.shape[1])
        if [self.corners, self.crop, self.grid].count(None) != 2:
            raise InputError("a view is chosen in one way: give --corners, --crop or --grid")
        if self.crop is not None:
            x, y, width, height = _numbers(self.crop, 4, "--crop")
            return View.of_box((round(x), round(y), round(width), round(height)), taken_shape)
        if self.corners is not None:
            if self.size is None:
                raise InputError("--corners needs --size, such as --size 240x320")
            width, height = _numbers(self.size.replace("x", ","), 2, "--size")
            flat = _numbers(",".join(self.corners.split()), 8, "--corners")
            corners = list(zip(flat[::2], flat[1::2], strict=True))
            return View.of_corners(corners, taken_shape, (round(height), round(width)))
        if self.spacing_px is None or self.pitch_mm is None or self.pixel_size_mm is None:
            raise InputError("--grid needs --spacing-px, --pitch-mm and --pixel-size-mm")
        if min(self.spacing_px, self.pitch_mm, self.pixel_size_mm) <= 0:
            raise InputError("--spacing-px, --pitch-mm and --pixel-size-mm: give lengths greater than 0")
        return view_of_grid(image, self.spacing_px, self.pitch_mm, self.pixel_size_mm)


@with_options
def command(
    images: Annotated[list[str], typer.Argument(metavar="IMAGE...", help="pictures as taken: files, folders, videos")],
    out: Annotated[Path, typer.Option(help=f"folder for the pictures of the view, and {VIEW}")],
    chosen: Chosen,
    white: Annotated[
        float | None,
        rare_option(help="level that is white in 16-bit pictures, such as 1023 of a camera of 10 bit", min=1),
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Take the view of the gel out of pictures, and write it.

    `detect` and `fit` then work on the pictures of the view; `fit --view` puts the view into the bundle, which then
    takes pictures as the camera gives them. `gellight calibrate --view` calibrates a camera so.
    """
    paths = [path for text in images for path in image_files(text)]
    view = chosen.view(paths[0])
    written = [out / f"{path.stem}.png" for path in paths]
    _refuse(paths, written, overwrite)
    try:
        _write(paths, written, lambda path: view.of(_read(path, white), str(path)))
        write_file(out / VIEW, (view.model_dump_json(indent=1) + "\n").encode())
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror or error}): choose another folder") from error
    result = {"view": str(out / VIEW), "images": [str(path) for path in written]}
    size = f"{view.width_px} x {view.height_px} px"
    show(result, as_json, f"wrote {len(written)} pictures of {size} and {out / VIEW}")


def _write(paths: Sequence[Path], written: Sequence[Path], seen: Callable[[Path], NDArray[np.uint8]]) -> None:
    """Write what is seen of each picture; nothing where one of them cannot be used. Raises OSError too."""
    with tempfile.TemporaryDirectory(prefix="gellight-view-") as made:
        places = [Path(made, f"{number}.png") for number in range(len(paths))]
        for path, place in zip(paths, places, strict=True):
            place.write_bytes(encode_png(seen(path)))
        written[0].parent.mkdir(parents=True, exist_ok=True)
        for place, target in zip(places, written, strict=True):
            write_file(target, place.read_bytes())


def _read(path: Path, white: float | None) -> NDArray[np.uint8]:
    if white is None:
        return read_image(path)
    levels = read_levels(path)
    grey = np.clip(np.rint(levels * (255 / white)), 0, 255).astype(np.uint8)
    return grey if grey.ndim == 3 else np.repeat(grey[..., None], 3, axis=2)


def _numbers(text: str, count: int, option: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count or not np.isfinite(found).all():
        raise InputError(f"{option} {text!r}: give {count} numbers")
    return found


def _refuse(paths: Sequence[Path], written: Sequence[Path], overwrite: bool) -> None:
    """Refuse to write one file twice, or over a picture that is read, or over anything without being allowed to."""
    names = [target.name.casefold() for target in written]
    for path, target in zip(paths, written, strict=True):
        if names.count(target.name.casefold()) > 1:
            raise InputError(f"{path} and another picture would both be written to {target}: take their views apart")
        if target.resolve() == path.resolve() or (target.exists() and not overwrite):
            raise InputError(f"{target} exists: give another folder to --out, or allow overwriting other pictures")
