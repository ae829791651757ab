"""One press as a map of heights: what of the object the gel reached, and how high it is there."""

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame
from gellight.lab.scanning.contact_view import reached_by
from gellight.lab.scanning.height_map import HeightMap

SAME_PIXEL = 0.005
"""by which the sides of a pixel may differ"""
NINE_IN_TEN = 1.645
"""standard deviations: what a bundle's bounds hold"""


def map_of_press(frame: TactileFrame, pixel_size_mm: tuple[float, float], error_mm: float | None = None) -> HeightMap:
    """Return the heights of what touches in one frame: the depth where the gel reached it.

    pixel_size_mm: (x, y). error_mm: standard deviation of the depth; None: as the frame's bundle knows. Raises
    InputError where nothing touches, for pixels that are not square, and where no error is known.
    """
    pixel = pixel_size_mm[0]
    if abs(pixel_size_mm[1] / pixel - 1) > SAME_PIXEL:
        raise InputError(f"pixels of {pixel_size_mm[0]} x {pixel_size_mm[1]} mm are not square: no map is made of them")
    reached = reached_by(frame.depth_mm, pixel_size_mm)
    if not reached.any():
        raise InputError("nothing touches the gel in this frame: choose one of a press")
    error = _errors(frame) if error_mm is None else np.full(frame.depth_mm.shape, error_mm, np.float32)
    known = reached & np.isfinite(error)
    nothing = np.float32(np.nan)
    return HeightMap(np.where(known, frame.depth_mm, nothing), np.where(known, error, nothing), pixel)


def _errors(frame: TactileFrame) -> NDArray[np.float32]:
    """(H, W) mm standard deviation of the depth, by the frame's bundle; inf where nobody knows."""
    if frame.error_bounds is None:
        raise InputError(
            "the bundle does not know by how much its depth is off: say it, as the roughness found on a polished plate"
        )
    return np.asarray(frame.error_bounds.shape_mm / np.float32(NINE_IN_TEN))
