"""`errors.json`: by how much nine in ten pixels are off at most, as presses of balls found that were not learnt from.

Three things tell where a frame is off: how steep it is, how deep beside its contact, and how near the rim. The
logarithm of the bound is a quadratic form of them. Disagreement of networks, distance from the colours that were
learnt, shadow and saturation told less on real presses.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from gellight.bundle.bundle_file import BundleFile
from gellight.frames.measures import ErrorBounds

FILE_NAME = "errors.json"
REMEDY = "calibrate again, or remove the file: frames then have no error"
COVERED = 0.9
"""share of the pixels that are off by at most the bound"""
AWAY = -9.0
"""radii from the rim of no contact"""
DEG_FLOOR, MM_FLOOR = 0.5, 0.003
"""added to an error before its logarithm is taken: less does not matter"""
TERMS = 10  # of a quadratic form of three numbers: 1 + 3 + 6
Floats = NDArray[np.float32]
Array = NDArray[np.float64]
Weights = Annotated[tuple[Annotated[float, Field(allow_inf_nan=False)], ...], Field(min_length=TERMS, max_length=TERMS)]


class ErrorRecord(BundleFile):
    """The content of the file."""

    file_name: ClassVar[str] = FILE_NAME
    remedy: ClassVar[str] = REMEDY
    presses: Annotated[int, Field(ge=1)]
    """that it was found on"""
    steepest: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    """slope of these presses; of steeper ones nothing is known"""
    least: tuple[float, float, float]
    """of `signs` on these presses: beyond, the end of the range is taken; farther from a contact nothing is known"""
    most: tuple[float, float, float]
    normal_weights: Weights
    shape_weights: Weights

    def bounds(self, gradient_map: Floats, depth_mm: Floats, touched: NDArray[np.bool_]) -> ErrorBounds:
        """Return the (H, W) bounds of a frame: inf where it is steeper than any press, and farther from a contact."""
        found = signs(gradient_map, depth_mm, touched)
        known = (found[..., 0] <= self.steepest) & (found[..., 2] >= self.least[2])
        within = np.clip(found[known], self.least, self.most)

        def bound(weights: Weights, floor: float) -> Floats:
            bounds = np.full(known.shape, np.inf, np.float32)
            bounds[known] = np.maximum(np.exp(quadratic_form(within, weights)) - floor, 0.0)
            return bounds

        return ErrorBounds(
            normal_deg=bound(self.normal_weights, DEG_FLOOR), shape_mm=bound(self.shape_weights, MM_FLOOR)
        )


@dataclass(frozen=True, eq=False)
class _Patches:
    """Each pixel's contact: the one it lies in, or the nearest."""

    rim: Array
    """(H, W) distance from its rim in its radii, positive inside"""
    deepest: Array
    """(H, W) its largest depth, mm"""


def signs(gradient_map: Floats, depth_mm: Floats, touched: NDArray[np.bool_]) -> Array:
    """(H, W, 3) slope, depth as a share of the contact's largest, and distance from its rim in its radii.

    The radius is that of a circle of the contact's area.
    """
    slope = np.hypot(gradient_map[..., 0], gradient_map[..., 1])
    if not touched.any():
        return np.stack([slope, np.zeros_like(slope), np.full_like(slope, AWAY)], axis=2, dtype=np.float64)
    patches = _patches(depth_mm, touched)
    share = np.clip(depth_mm / np.maximum(patches.deepest, 1e-6), 0.0, 1.0)
    return np.stack([slope, share, patches.rim], axis=2, dtype=np.float64)


def _patches(depth_mm: Floats, touched: NDArray[np.bool_]) -> _Patches:
    from scipy import ndimage  # SciPy takes longer than all else of a start

    outside, (row, column) = ndimage.distance_transform_edt(~touched, return_indices=True)
    distance = ndimage.distance_transform_edt(touched) - outside
    numbers, count = ndimage.label(touched)
    every = np.arange(1, count + 1)
    radius = np.sqrt(ndimage.sum_labels(touched, numbers, every) / np.pi)
    deepest = np.full(count, -np.inf)
    np.maximum.at(deepest, numbers[touched] - 1, depth_mm[touched])  # ndimage.maximum sorts the whole map
    own = numbers[row, column] - 1
    return _Patches(rim=distance / radius[own], deepest=deepest[own])


def quadratic(found: Array) -> Array:
    """(..., 10) all products of at most two of (..., 3) numbers."""
    a, b, c = np.moveaxis(found, -1, 0)
    return np.stack([np.ones_like(a), a, b, c, a * a, b * b, c * c, a * b, a * c, b * c], axis=-1)


def quadratic_form(found: Array, weights: Weights) -> Array:
    """(...) `quadratic(found) @ weights`, without ten arrays of the size of the picture."""
    a, b, c = np.moveaxis(found, -1, 0)
    one, *first, aa, bb, cc, ab, ac, bc = weights
    of_a, of_b, of_c = first
    form = one + a * (of_a + aa * a + ab * b + ac * c) + b * (of_b + bb * b + bc * c) + c * (of_c + cc * c)
    return np.asarray(form)
