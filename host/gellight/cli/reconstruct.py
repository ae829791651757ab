"""`gellight reconstruct`: pictures of the gel to depth, normals and contact."""

from pathlib import Path
from typing import Annotated

import typer

from gellight.cli.options import AsJson


def command(
    images: Annotated[list[str], typer.Argument(metavar="IMAGE...", help="Image files, folders or quoted patterns.")],
    out: Annotated[Path, typer.Option(help="Folder for NAME.npz and NAME.png of each image; created if need be.")],
    calibration: Annotated[str, typer.Option(help="Bundle: a folder, a .gelcal file, or 'synthetic'.")],
    white: Annotated[
        float | None,
        typer.Option(min=1, help="With several lights: level that is white.", show_default="255, or 65535 of 16 bit"),
    ] = None,
    least_squares: Annotated[
        bool, typer.Option("--least-squares", help="With a bundle of several lights: without its network.")
    ] = False,
    as_json: AsJson = False,
    depth_scale_um: Annotated[float, typer.Option(min=1, help="Depth of the brightest colour, micrometres.")] = 1000,
) -> None:
    """Reconstruct depth and contact from pictures of the gel.

    NAME.npz has gradient_map (H, W, 2), normal_map (H, W, 3), depth_mm (H, W), all float32, contact (H, W) bool,
    confidence (H, W) float32 and quality_flags (H, W) uint8; normal_error_deg and shape_error_mm (H, W) where the
    bundle knows its errors; pressure_mpa (H, W), force_n and force_error_n where it knows its force; findings, lines of
    text, what is known against it. Where an image is deeper than the gel is thick, or most of its contact is a guess,
    as by another sensor's bundle, all is written, and the exit status is 1. With a bundle that `calibrate channels`
    made, the images are one series, one for each light, and NAME is that of the first image. Each file is written whole
    or not at all. At an image that cannot be used the work ends with its name; what was written before stays.
    """
    from gellight.cli.running.reconstruct import reconstruct  # not for the help

    reconstruct(
        images, out, calibration, white=white, least_squares=least_squares, scale_um=depth_scale_um, as_json=as_json
    )
