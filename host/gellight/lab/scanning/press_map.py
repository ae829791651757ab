"""One press as a map of heights: what of the object the gel reached, and how high it is there."""

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame
from gellight.frames.pixel_grid import spread_blocks
from gellight.lab.scanning.filtering import Array, waviness
from gellight.lab.scanning.height_map import HeightMap
from gellight.reconstruction.force import Layer, indenting

GEL_POISSON_RATIO = 0.49
"""where nobody told: silicone hardly changes its volume"""
LEAST_PRESSURE = 0.2
"""of the mean around: where the gel's shape asks for less, it spans a valley"""
SAME_PIXEL = 0.005
"""by which the sides of a pixel may differ"""
NINE_IN_TEN = 1.645
"""standard deviations: what a bundle's bounds hold"""


def map_of_press(
    frame: TactileFrame, pixel_size_mm: tuple[float, float], layer: Layer, error_mm: float | None = None
) -> HeightMap:
    """Return the heights of what touches in one frame: the depth where the gel reached it.

    pixel_size_mm: (x, y). layer: the gel. error_mm: standard deviation of the depth; None: as the frame's bundle knows.
    Raises InputError where nothing touches, for pixels that are not square, and where no error is known.
    """
    pixel = pixel_size_mm[0]
    if abs(pixel_size_mm[1] / pixel - 1) > SAME_PIXEL:
        raise InputError(f"pixels of {pixel_size_mm[0]} x {pixel_size_mm[1]} mm are not square: no map is made of them")
    if not frame.contact.mask.any():
        raise InputError("nothing touches the gel in this frame: choose one of a press")
    reached = reached_by_gel(frame.depth_mm, frame.contact.mask, pixel_size_mm, layer)
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


def reached_by_gel(
    depth_mm: NDArray[np.floating], contact: NDArray[np.bool_], pixel_size_mm: tuple[float, float], layer: Layer
) -> NDArray[np.bool_]:
    """(H, W): where within the outline of a contact the gel touches the object, and does not span a valley.

    The pressure that makes a relief of wave number k is E k / (2 (1 - nu^2)) of it, as on a half space (Johnson,
    Contact Mechanics, 1985, section 13.2); it adds to the mean pressure around. A gel that spans a valley has none.
    """
    outline = binary_fill_holes(contact)
    cutoff_px = layer.thickness_mm / pixel_size_mm[0]
    depth = np.where(outline, depth_mm.astype(np.float64), np.nan)
    relief = np.where(outline, depth - waviness(depth, cutoff_px), 0.0)
    found = indenting(depth_mm, pixel_size_mm, layer)
    shape = depth_mm.shape[0], depth_mm.shape[1]
    pressure = spread_blocks(found.pressure.astype(np.float32), found.side_px, shape)
    around = waviness(np.where(outline, pressure, np.nan), cutoff_px)
    return np.asarray(outline & (around + _pressure_of(relief, pixel_size_mm, layer) > LEAST_PRESSURE * around))


def _pressure_of(relief_mm: Array, pixel_size_mm: tuple[float, float], layer: Layer) -> Array:
    """(H, W) pressure that makes a relief, as a share of Young's modulus."""
    along_x = scipy.fft.rfftfreq(relief_mm.shape[1], pixel_size_mm[0])
    along_y = scipy.fft.fftfreq(relief_mm.shape[0], pixel_size_mm[1])
    k = 2 * np.pi * np.hypot(along_x[None, :], along_y[:, None])
    stiffness = k / (2 * (1 - layer.poisson_ratio**2))
    return np.asarray(scipy.fft.irfft2(scipy.fft.rfft2(relief_mm) * stiffness, s=relief_mm.shape))
