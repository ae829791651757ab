"""A map of heights as a file for other programs; the ending of its name says which."""

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.frames.point_cloud import ply, solid_stl
from gellight.lab.report.pictures import depth_picture, encode_png
from gellight_scan.height_map import HeightMap
from gellight_scan.pictures import height_picture

MOST_TRIANGLED = 4_000_000
"""pixels that become triangles: an STL of so many has 800 MB"""
FOOT_MM = 2.0
"""of solid below the lowest height of an STL"""


def write_maps(surface: HeightMap, paths: Sequence[Path]) -> None:
    """Write a map as PNG, X3P, PLY, STL or npz, each file whole, and none where one of them cannot be made.

    Raises InputError for another ending, for a map without heights, where the package for X3P is not installed, and
    where a file cannot be written.
    """
    contents = [content_of(surface, path) for path in paths]
    for path, content in zip(paths, contents, strict=True):
        try:
            write_file(path, content)
        except OSError as error:
            raise InputError(
                f"{path} was not written ({error.strerror}): choose another folder, or free space"
            ) from error


def content_of(surface: HeightMap, path: Path) -> bytes:
    """Return what a file of this name holds of a map; raises InputError as `write_maps` does."""
    if path.suffix.lower() not in CONTENTS:
        raise InputError(f"{path}: no file of this kind is written; end its name with one of {', '.join(CONTENTS)}")
    if not surface.reached.any():
        raise InputError("the map holds no heights: the gel reached nothing; press or scan the surface again")
    return CONTENTS[path.suffix.lower()](surface)


def _png(surface: HeightMap) -> bytes:
    return encode_png(height_picture(surface.height_mm, surface.pixel_mm))


def _x3p(surface: HeightMap) -> bytes:
    """ISO 25178-72: metres, axes right-handed, so the rows run upwards; NaN where nothing was measured."""
    import x3pio  # here, as nothing else needs it

    content, pixel_m = io.BytesIO(), surface.pixel_mm / 1e3
    probe = x3pio.ProbingSystem(x3pio.ProbingType.CONTACTING, "camera-based tactile sensor")
    metadata = x3pio.Metadata(instrument=x3pio.Instrument("GelLight"), probing_system=probe)
    heights_m = surface.height_mm[::-1].astype(np.float64) / 1e3
    x3pio.write(content, heights_m, x_scale=pixel_m, y_scale=pixel_m, metadata=metadata)
    return content.getvalue()


def _ply(surface: HeightMap) -> bytes:
    height = _triangled(surface)
    low, high = float(np.nanmin(height)), float(np.nanmax(height))
    colours = depth_picture(np.nan_to_num(height) - low, scale_um=max((high - low) * 1e3, 1e-3))
    return ply(height, (surface.pixel_mm, surface.pixel_mm), colours)


def _stl(surface: HeightMap) -> bytes:
    height = _triangled(surface)
    return solid_stl(height, surface.pixel_mm, float(np.nanmin(height)) - FOOT_MM)


def _triangled(surface: HeightMap) -> NDArray[np.float32]:
    """(H, W) mm of a map that is small enough for triangles; InputError for a larger one."""
    count = int(np.count_nonzero(surface.reached))
    if count > MOST_TRIANGLED:
        raise InputError(f"{count} pixels would become a huge mesh; up to {MOST_TRIANGLED} do: write .x3p or .npz")
    return surface.height_mm


CONTENTS: Mapping[str, Callable[[HeightMap], bytes]] = {
    ".png": _png,
    ".x3p": _x3p,
    ".ply": _ply,
    ".stl": _stl,
    ".npz": HeightMap.content,
}
