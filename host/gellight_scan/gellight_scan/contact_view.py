"""One press of a scan: the gel's surface, and where it lies on the part.

Only there it has the shape of the part. Between the peaks of a rough part the gel hangs free, and is deep all the same:
depth is no contact. So the pressure is found under which an elastic layer is as deep as the map says (as tracking does,
on a finer grid, for a part has many small contacts), and what is pressed less than a share of the usual is left out.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from gellight.frames.pixel_grid import between_blocks
from gellight.reconstruction.integration import surface_gradient
from gellight_scan.tracking.view import (
    COATING_MM,
    LEAST_MM,
    THICKNESS_MM,
    WORKING_PX,
    View,
    eroded,
    pressure_of,
    reduced,
)

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
LEAST_SHARE = 0.05
"""of the pressure that a tenth of what is pressed exceeds: gel under less may hang free"""
RIM_MM = 0.18
"""of each contact's rim that is left out: what the coating blurs there differs from press to press"""
STEEP, STEEP_RIM_MM = 1.5, 0.36
"""where the height is so many times as uncertain as usual, the rim is as wide as the coating's blur reaches: beside a
steep edge the blurred gel looks pressed, and the map would run down the side of the part"""
BORDER_PX = 3
"""of the picture, where the filters of the frame path see one side alone"""
HALF = 0.5
MIRRORED_PX = 16
_INNER = slice(MIRRORED_PX, -MIRRORED_PX)
BASE_MM = 0.003
"""standard deviation of the depth that is not explained otherwise: of simulated presses, beside their plane"""
AROUND_MM = 0.25
"""whose curvature says how far the coating is off"""


@dataclass(frozen=True, eq=False)
class ContactView:
    """The gel of one press."""

    depth_mm: Floats
    """(H, W) mm"""
    pixel_size_mm: tuple[float, float]
    calibration: str
    """identity of the bundle that the depth was found by"""
    thickness_mm: float | None = None
    """of the gel; None where nobody knows"""

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the view."""
        height, width = self.depth_mm.shape
        return width * self.pixel_size_mm[0], height * self.pixel_size_mm[1]

    @cached_property
    def reached(self) -> Bools:
        """(H, W) where the gel lies on the part."""
        return reached_by(self.depth_mm, self.pixel_size_mm, self.thickness_mm)

    @cached_property
    def view(self) -> View:
        """The maps at the size that registration works at, with the gel that reached the part."""
        factor = _factor(self.depth_mm)
        slopes = surface_gradient(self.depth_mm, self.pixel_size_mm)
        planes = reduced(np.dstack([self.depth_mm, slopes]).astype(np.float32, copy=False), factor)
        pixel = self.pixel_size_mm[0] * factor, self.pixel_size_mm[1] * factor
        middle = [((size - 1) / 2 - (factor - 1) / 2) / factor for size in self.depth_mm.shape[::-1]]
        reached = reduced(self.reached.astype(np.float32), factor) > HALF
        return View(planes, reached, reached, pixel, (middle[0], middle[1]))

    @cached_property
    def error_mm(self) -> Floats:
        """(H, W) standard deviation of the height of the part, mm, where it was reached."""
        return _error_mm(self.depth_mm, self.pixel_size_mm)

    @property
    def share(self) -> float:
        """Share of the view where the gel lies on the part."""
        return float(self.view.touching.mean())


def reached_by(depth_mm: Floats, pixel_size_mm: tuple[float, float], thickness_mm: float | None) -> Bools:
    """Return the (H, W) pixels where gel of this depth lies on what it is pressed by; None: nobody knows how thick."""
    factor = _factor(depth_mm)
    depth = reduced(depth_mm, factor)
    # Gel that is cut by the border of the view goes on; cut off, it would look pressed there.
    wider = np.pad(depth, MIRRORED_PX, mode="symmetric")
    pixel = pixel_size_mm[0] * factor, pixel_size_mm[1] * factor
    pressure = pressure_of(wider, pixel, thickness_mm or THICKNESS_MM, coarser=1)[_INNER, _INNER]
    pressed = pressure[(depth > LEAST_MM) & (pressure > 0)]
    if not len(pressed):
        return np.zeros(depth_mm.shape, np.bool_)
    level = LEAST_SHARE * float(np.percentile(pressed, 90))
    contact = between_blocks(np.where(depth > LEAST_MM, pressure, 0), factor, depth_mm.shape) > level
    border = BORDER_PX * factor
    contact[:border] = contact[-border:] = contact[:, :border] = contact[:, -border:] = False
    reached = eroded(contact, RIM_MM, pixel_size_mm)
    if not reached.any():
        return reached
    error = _error_mm(depth_mm, pixel_size_mm)
    usual = error < STEEP * float(np.median(error[reached]))
    return reached & (usual | eroded(contact, STEEP_RIM_MM, pixel_size_mm))


def _error_mm(depth_mm: Floats, pixel_size_mm: tuple[float, float]) -> Floats:
    """Return the (H, W) standard deviation of the height of a part that gel of this depth lies on.

    The coating blurs the surface by a Gaussian of s = `COATING_MM`, which is off by s^2 / 2 times the curvature: by
    that of the surroundings, since where a rough surface is straight by chance the next order counts.
    """
    curved = surface_gradient(depth_mm, pixel_size_mm)
    bend = surface_gradient(curved[..., 0], pixel_size_mm)[..., 0]
    bend += surface_gradient(curved[..., 1], pixel_size_mm)[..., 1]
    around = gaussian_filter(bend**2, [AROUND_MM / size for size in pixel_size_mm[::-1]])
    return np.asarray(np.sqrt(BASE_MM**2 + COATING_MM**4 / 4 * around), np.float32)


def _factor(depth_mm: Floats) -> int:
    """Return by how much smaller the maps are that registration works on."""
    return max(1, round(int(depth_mm.shape[1]) / WORKING_PX))
