"""What tracking takes of a frame: its maps at working size, and where the gel lies on the object.

Only there the gel has the shape of the object. The gel around it is dragged along, and a threshold of the depth takes
that for contact. So the pressure is found under which an elastic layer is as deep as the map says, and the contact is
where there is some. The coating blurs the rim of the contact, so the outermost pixels are left out.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from gellight.frames.pixel_grid import bounding_box, over_gel
from gellight.reconstruction.force import bonded

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
WORKING_PX = 320
"""across: larger maps are reduced by whole factors"""
COARSER = 2
"""by so much more is the grid of the pressure, whose rim a pixel more or less is no matter"""
COATING_MM = 0.12
"""standard deviation of what blurs the pressure"""
THICKNESS_MM = 5.0
"""of a gel that nobody knows better; the pressure's place hardly depends on it"""
RIM_MM = 0.25
"""of the contact's rim that is left out: the coating's blur"""
INNER_MM = 0.12
"""farther inside than that the rim has no part in the curvatures: it moves with the contact and not with the object"""
LEAST_PRESSURE = 0.15
"""of the pressure that a tenth of the contact exceeds: less is no contact"""
LEAST_MM = 0.02
"""what is less deep is not looked at"""


@dataclass(frozen=True, eq=False)
class View:
    """The maps of a frame at working size; in the order of OpenCV, so that one call samples them all."""

    planes: Floats
    """(h, w, 3) depth in mm, d(depth)/dx, d(depth)/dy"""
    touching: Bools
    """(h, w) where the gel lies on the object, without the rim"""
    inside: Bools
    """(h, w) of these, where not even the curvatures know of the rim"""
    pixel_mm: tuple[float, float]
    middle_px: tuple[float, float]
    """column and row of the middle of the frame"""

    @classmethod
    def of(
        cls,
        depth_mm: Floats,
        gradient_map: Floats,
        pixel_size_mm: tuple[float, float],
        *,
        camera_height_mm: float,
        thickness_mm: float | None = None,
    ) -> "View":
        """Reduce a (H, W) depth map and its (H, W, 2) slopes, lay them over the gel, and find the contact.

        camera_height_mm: as `over_gel` has it; 0 for maps along parallel rays.
        """
        factor = max(1, round(depth_mm.shape[1] / WORKING_PX))
        planes = reduced(np.dstack([depth_mm, gradient_map]).astype(np.float32, copy=False), factor)
        planes = over_gel(planes, camera_height_mm)
        pixel = pixel_size_mm[0] * factor, pixel_size_mm[1] * factor
        pressure = pressure_of(np.ascontiguousarray(planes[..., 0]), pixel, thickness_mm or THICKNESS_MM)
        middle = [((size - 1) / 2 - (factor - 1) / 2) / factor for size in depth_mm.shape[::-1]]
        touched = touching(pressure, planes[..., 0], pixel)
        return cls(planes, touched, eroded(touched, INNER_MM, pixel), pixel, (middle[0], middle[1]))

    @property
    def area_mm2(self) -> float:
        """How much of the gel lies on the object."""
        return float(np.count_nonzero(self.touching)) * self.pixel_mm[0] * self.pixel_mm[1]

    @cached_property
    def curvatures(self) -> Floats:
        """(h, w, 3) d2(depth)/dx2, dx dy and dy2 in 1/mm, about the contact; 0 elsewhere."""
        rows, columns = bounding_box(self.touching, 4)
        part = self.planes[rows, columns]
        along = [cv2.Sobel(part[..., 1:], cv2.CV_32F, *order, ksize=5, scale=1 / 128) for order in ((1, 0), (0, 1))]
        x, y = along[0] / np.float32(self.pixel_mm[0]), along[1] / np.float32(self.pixel_mm[1])
        curvatures = np.zeros_like(self.planes)
        curvatures[rows, columns] = np.dstack([x[..., 0], (x[..., 1] + y[..., 0]) / 2, y[..., 1]])
        return curvatures

    def pixels(self, points_mm: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the (N, 2) columns and rows of points (N, 3)."""
        return np.asarray(points_mm[:, :2] / self.pixel_mm + self.middle_px, np.float32)

    def places(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the (N, 3) points of the surface at pixels."""
        x, y = (columns - self.middle_px[0]) * self.pixel_mm[0], (rows - self.middle_px[1]) * self.pixel_mm[1]
        return np.stack([x, y, self.planes[rows, columns, 0].astype(np.float64)], axis=1)

    def sampled(self, planes: Floats, pixels: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return (N, 3) values of planes at (N, 2) columns and rows, between pixels linear."""
        x, y = np.ascontiguousarray(pixels.T)[:, None]
        return np.asarray(cv2.remap(planes, x, y, cv2.INTER_LINEAR)[0], np.float64)

    @cached_property
    def centre_mm(self) -> NDArray[np.float64]:
        """(3,) the middle of the contact, on the surface."""
        rows, columns = np.nonzero(self.touching)
        return np.asarray(self.places(rows, columns).mean(axis=0)) if len(rows) else np.zeros(3)


def at_pixels(mask: Bools, pixels: NDArray[np.float32]) -> Bools:
    """Return what a (h, w) mask says at (N, 2) columns and rows, nearest; beyond it False."""
    height, width = mask.shape
    column, row = np.rint(np.clip(pixels, -1, max(width, height))).astype(np.intp).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    inside[inside] = mask[row[inside], column[inside]]
    return np.asarray(inside)


def pressure_of(
    depth_mm: Floats, pixel_mm: tuple[float, float], thickness_mm: float, *, coarser: int = COARSER
) -> Floats:
    """Return the (h, w) pressure under which an elastic layer is as deep as a map, blurred, to a constant factor.

    In Fourier space it is the depth over the compliance of the layer (see `reconstruction.force`). coarser: by so much
    is the grid that it is found on.
    """
    coarse = reduced(depth_mm, coarser)
    size = pixel_mm[1] * coarser, pixel_mm[0] * coarser
    margin = [round(thickness_mm / 2 / step) for step in size]
    shape = tuple(scipy.fft.next_fast_len(n + more, real=True) for n, more in zip(coarse.shape, margin, strict=True))
    stiffness = _stiffness((shape[0], shape[1]), size, thickness_mm)
    pressure = scipy.fft.irfft2(scipy.fft.rfft2(coarse, s=shape) * stiffness, s=shape)
    part = np.ascontiguousarray(pressure[: coarse.shape[0], : coarse.shape[1]], np.float32)
    return np.asarray(cv2.resize(part, depth_mm.shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32)


def touching(pressure: Floats, depth_mm: Floats, pixel_mm: tuple[float, float]) -> Bools:
    """Return the (h, w) pixels that lie on the object, without the rim of the contact and the border of the picture."""
    deep = depth_mm > LEAST_MM
    pressed = pressure[deep & (pressure > 0)]
    strong = pressed[pressed > pressed.mean()] if len(pressed) else pressed
    if not len(strong):  # nothing is pressed, or a single pixel
        return np.zeros(depth_mm.shape, np.bool_)
    level = LEAST_PRESSURE * float(np.percentile(strong, 75))
    contact = deep & (pressure > level)
    contact[[0, -1]] = contact[:, [0, -1]] = False
    return eroded(contact, RIM_MM, pixel_mm)


def eroded(mask: Bools, by_mm: float, pixel_mm: tuple[float, float]) -> Bools:
    """Return a (h, w) mask without its outermost `by_mm`, at least a pixel."""
    across, down = (2 * max(1, round(by_mm / size)) + 1 for size in pixel_mm)
    return np.asarray(cv2.erode(mask.astype(np.uint8), np.ones((down, across), np.uint8)), np.bool_)


@lru_cache(maxsize=8)
def _stiffness(shape: tuple[int, int], size_mm: tuple[float, float], thickness_mm: float) -> Floats:
    """Return 1 / G(k) of an incompressible layer times the blur, on the grid of a real FFT; no mean pressure."""
    down, across = scipy.fft.fftfreq(shape[0], size_mm[0]), scipy.fft.rfftfreq(shape[1], size_mm[1])
    k = 2 * np.pi * np.hypot(across[None, :], down[:, None])
    q = np.maximum(k * thickness_mm, 1e-3)
    stiffness = np.exp(-((k * COATING_MM) ** 2) / 2) / np.maximum(bonded(q, 0.5) / np.maximum(k, 1e-6), 1e-9)
    stiffness[0, 0] = 0.0
    return np.asarray(stiffness, np.float32)


def reduced(planes: Floats, factor: int) -> Floats:
    """Return planes (h, w, ...) made smaller by a whole factor: means of blocks."""
    if factor == 1:
        return planes
    height, width = (size // factor for size in planes.shape[:2])
    whole = planes[: height * factor, : width * factor]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.float32)
