"""`gellight reconstruct`: pictures of the gel to depth, normals and contact."""

import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gellight.base.errors import InputError

if TYPE_CHECKING:
    from gellight.frames.frames import TactileFrame


def command(
    images: Annotated[list[str], typer.Argument(metavar="IMAGE...", help="Image files, folders or quoted patterns.")],
    calibration: Annotated[str, typer.Option(help="Bundle: a folder, a .gelcal file, or 'synthetic'.")],
    out: Annotated[Path, typer.Option(help="Folder for NAME.npz and NAME.png of each image; created if need be.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the contacts as a JSON array.")] = False,
    depth_scale_um: Annotated[float, typer.Option(min=1, help="Depth of the brightest colour, micrometres.")] = 1000,
    dense: Annotated[bool, typer.Option("--dense", help="Run the network on untouched pixels too.")] = False,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the network.")] = 1,
) -> None:
    """Reconstruct depth, normals and contact from images of the gel.

    NAME.npz has gradient_map (H, W, 2), normal_map (H, W, 3), depth_mm (H, W), all float32, and contact (H, W) bool.
    Each file is written whole or not at all. At an image that cannot be used the work ends with its name; what was
    written before stays.
    """
    from gellight.bundle.bundle import load_bundle
    from gellight.frames.image_files import ImageCamera, image_files
    from gellight.reconstruction.pipeline import Reconstructor

    paths = [path for text in images for path in image_files(text)]
    _refuse_clashes(paths, out)
    reconstructor = Reconstructor(load_bundle(calibration), threads=threads, masked=not dense)
    contacts = []
    with ImageCamera(paths) as camera:
        for path in paths:
            frame = reconstructor.reconstruct(camera.read())
            _write(frame, out, path.stem, depth_scale_um)
            contacts.append(_contact(frame, path, out))
    typer.echo(json.dumps(contacts, indent=2) if as_json else _table(contacts))


def _refuse_clashes(paths: Sequence[Path], out: Path) -> None:
    """Before any work: two images must not write one file, and no result may replace an image."""
    by_stem: dict[str, Path] = {}
    sources = {path.resolve() for path in paths}
    for path in paths:
        # Folded, because some file systems take ball.png and Ball.png for one file.
        other = by_stem.setdefault(path.stem.casefold(), path)
        if other is not path:
            raise InputError(f"{other} and {path} would both be written to {path.stem}.npz: reconstruct them apart")
        if (out / f"{path.stem}.png").resolve() in sources:
            raise InputError(f"the picture of {path} would replace an image in {out}: give another folder to --out")


def _write(frame: "TactileFrame", out: Path, stem: str, depth_scale_um: float) -> None:
    import numpy as np

    from gellight.base.writing import write_file
    from gellight.report.pictures import encode_png, four_panels

    maps = io.BytesIO()
    np.savez(
        maps,
        gradient_map=frame.gradient_map,
        normal_map=frame.normal_map,
        depth_mm=frame.depth_mm,
        contact=frame.contact.mask,
    )
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_file(out / f"{stem}.npz", maps.getvalue())
        write_file(out / f"{stem}.png", encode_png(four_panels(frame, scale_um=depth_scale_um)))
    except OSError as error:
        raise InputError(
            f"{out / stem}.npz or .png was not written ({error.strerror}): give --out a folder that can be written "
            "and has space"
        ) from error


def _contact(frame: "TactileFrame", path: Path, out: Path) -> dict[str, Any]:
    contact = frame.contact
    return {
        "image": str(path),
        "npz": str(out / f"{path.stem}.npz"),
        "png": str(out / f"{path.stem}.png"),
        "indentation_mm": contact.indentation_mm,
        "area_mm2": contact.area_mm2,
        "centroid_mm": contact.centroid_mm,
    }


def _table(contacts: Sequence[dict[str, Any]]) -> str:
    width = max(5, *(len(Path(c["image"]).name) for c in contacts))
    lines = [f"{'image':{width}}  indentation mm  area mm2  centroid mm (x, y)"]
    for c in contacts:
        place = f"{c['centroid_mm'][0]:8.3f}, {c['centroid_mm'][1]:.3f}" if c["centroid_mm"] else "      no contact"
        name = Path(c["image"]).name
        lines.append(f"{name:{width}}  {c['indentation_mm']:14.4f}  {c['area_mm2']:8.3f}  {place}")
    return "\n".join(lines)
