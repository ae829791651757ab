"""`HeightMap`: what was found of a surface, on a grid, with its error, and kept as npz; one press as such a map."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError, first_line
from gellight.base.writing import write_file
from gellight.bundle.contents import UNZIPPING, arrays_of, npz, read_file
from gellight.frames.frames import TactileFrame
from gellight.frames.pixel_grid import over_gel
from gellight_scan.contact_view import reached_by

FIELDS = ("height_mm", "error_mm", "pixel_mm")
SAME_PIXEL = 0.005
"""by which the sides of a pixel may differ"""
NINE_IN_TEN = 1.645
"""standard deviations: what a bundle's bounds hold"""


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights of a surface on a grid.

    Raises `InputError` if the arrays differ in shape or are no picture, or if a pixel has no positive size.
    """

    height_mm: NDArray[np.float32]
    """(H, W) mm towards whoever looks at the surface; NaN where the gel did not reach it. x right, y down"""
    error_mm: NDArray[np.float32]
    """(H, W) mm, standard deviation of the height; NaN where the height is"""
    pixel_mm: float
    """mm, side of a pixel"""

    def __post_init__(self) -> None:
        """Refuse what is no map."""
        if self.height_mm.ndim != 2 or self.height_mm.size == 0 or self.height_mm.shape != self.error_mm.shape:
            raise InputError(
                f"heights of shape {self.height_mm.shape} with errors of {self.error_mm.shape} are no map; "
                "both are (rows, columns)"
            )
        if not (np.isfinite(self.pixel_mm) and self.pixel_mm > 0):
            raise InputError(f"a pixel of {self.pixel_mm} mm is none; its side is a positive length")

    @property
    def reached(self) -> NDArray[np.bool_]:
        """(H, W) bool: where the height is known."""
        return np.isfinite(self.height_mm)

    def save(self, path: Path) -> None:
        """Write the map as an npz file, whole or not at all."""
        write_file(path, self.content())

    def content(self) -> bytes:
        """Return the map as the content of an npz file."""
        return npz({name: np.asarray(getattr(self, name)) for name in FIELDS})


def load_height_map(path: Path) -> HeightMap:
    """Read a map that `HeightMap.save` wrote.

    Raises `InputError` if the file cannot be read, is none, or is far too large.
    """
    try:
        arrays = arrays_of(read_file(path))
        height, error, pixel = (arrays[name] for name in FIELDS)
        return HeightMap(height.astype(np.float32), error.astype(np.float32), float(pixel))
    except (*UNZIPPING, KeyError, TypeError) as problem:
        raise InputError(
            f"{path} is no map of heights ({first_line(problem)}); `gellight scan` writes one"
        ) from problem


def map_of_press(frame: TactileFrame, pixel_size_mm: tuple[float, float], error_mm: float | None = None) -> HeightMap:
    """Return the heights of what touches in one frame: the depth where the gel reached it.

    pixel_size_mm: (x, y). error_mm: standard deviation of the depth; None: as the frame's bundle knows. Raises
    InputError where nothing touches, for pixels that are not square, and where no error is known.
    """
    pixel = pixel_size_mm[0]
    if abs(pixel_size_mm[1] / pixel - 1) > SAME_PIXEL:
        raise InputError(f"pixels of {pixel_size_mm[0]} x {pixel_size_mm[1]} mm are not square: no map is made of them")
    thickness_mm = frame.provenance.gel_thickness_mm if frame.provenance else None
    height_mm = frame.provenance.camera_height_mm if frame.provenance else 0.0
    depth = over_gel(frame.depth_mm, height_mm)
    reached = reached_by(depth, pixel_size_mm, thickness_mm)
    if not reached.any():
        raise InputError("nothing touches the gel in this frame: choose one of a press")
    error = np.full(depth.shape, error_mm, np.float32) if error_mm is not None else _errors(frame)
    error = over_gel(np.dstack([frame.depth_mm, error]), height_mm)[..., 1]
    known = reached & np.isfinite(error)
    nothing = np.float32(np.nan)
    return HeightMap(np.where(known, depth, nothing), np.where(known, error, nothing), pixel)


def _errors(frame: TactileFrame) -> NDArray[np.float32]:
    """(H, W) mm standard deviation of the depth, by the frame's bundle; inf where nobody knows."""
    if frame.error_bounds is None:
        raise InputError(
            "the bundle does not know by how much its depth is off: say it, as the roughness found on a polished plate"
        )
    return np.asarray(frame.error_bounds.shape_mm / np.float32(NINE_IN_TEN))
