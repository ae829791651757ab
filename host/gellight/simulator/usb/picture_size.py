"""The geometry of a virtual sensor: as the settings say, at another number of pixels."""

import re

from gellight.base.errors import InputError
from gellight.base.settings import load_settings


def sized_geometry(size: str | None) -> dict[str, float | int | str]:
    """Return the settings' geometry with a picture of `size` ("160x120") that shows the same width of the gel.

    Raises InputError for a size that is none, or that no camera of this kind has.
    """
    geometry = load_settings().geometry.overrides()
    if size is None:
        return geometry
    match = re.fullmatch(r"(\d+)x(\d+)", size)
    width, height = (int(match[1]), int(match[2])) if match else (0, 0)
    if not (16 <= width <= 4096 and 16 <= height <= 4096 and width % 2 == 0):
        raise InputError(f"size {size!r}: give WIDTHxHEIGHT from 16 to 4096 pixels, an even width, for example 320x240")
    shown_mm = float(geometry.get("pixel_size_mm", 0.0588)) * int(geometry.get("image_width_px", 640))
    return {**geometry, "image_width_px": width, "image_height_px": height, "pixel_size_mm": shown_mm / width}
