"""The camera of a bundle as a pinhole with the distortion of OpenCV's, which is ROS 2's `plumb_bob`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.reconstruction.lens.model import half_diagonal_px, middle_px
from gellight.reconstruction.lens.undistortion import LensRecord, lens_of


@dataclass(frozen=True, kw_only=True, eq=False)
class Intrinsics:
    """One camera, for pictures of one size."""

    matrix: NDArray[np.float64]
    """(3, 3) K, px"""
    distortion: tuple[float, float]
    """k1 and k2"""


def intrinsics(bundle: Bundle, distance_mm: float) -> Intrinsics:
    """Return the camera of a bundle whose gel is at this distance; without a lens file it has no distortion.

    Raises BundleError for a lens file that is damaged.
    """
    matrix, record = np.eye(3), LensRecord.in_bundle(bundle)
    if record is None:
        matrix[:2, :2] = np.diag(distance_mm / np.array(bundle.pixel_size_mm))
        matrix[:2, 2] = middle_px(bundle.image_shape)
        return Intrinsics(matrix=matrix, distortion=(0.0, 0.0))
    lens = lens_of(record)
    matrix[:2, :2] = lens.scale * distance_mm
    matrix[:2, 2] = lens.centre_px
    focal_lengths = np.sqrt(np.linalg.det(lens.scale)) * distance_mm / half_diagonal_px(lens.image_shape)
    return Intrinsics(matrix=matrix, distortion=(float(lens.k1 * focal_lengths**2), float(lens.k2 * focal_lengths**4)))
