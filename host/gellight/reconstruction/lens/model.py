"""Where the camera sees a point of the gel: an affine map, and radial distortion about a centre.

    picture = c + q (1 + k1 r^2 + k2 r^4),   q = S (gel + origin),   r = |q| / (half the diagonal of the picture)

The direction, from the object to the picture, is that of Brown (1966) and of OpenCV; barrel distortion has k1 < 0. S is
symmetric: it holds the scale along each axis and the shear, and leaves the axes of the gel where those of the picture
are. Gel coordinates are mm from the point of the gel that is seen in the middle of the picture.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_INVERSE_STEPS = 12
"""Newton doubles the digits each time; five suffice for 20 % of distortion"""


@dataclass(frozen=True, kw_only=True)
class Lens:
    """The distortion of one camera, for pictures of one size."""

    image_shape: tuple[int, int]
    """(H, W)"""
    centre_px: tuple[float, float]
    """(x, y) of the distortion"""
    k1: float
    k2: float
    px_per_mm: tuple[float, float, float]
    """xx, xy, yy of S"""
    origin_mm: tuple[float, float]

    @cached_property
    def scale(self) -> Array:
        """(2, 2) S, px per mm."""
        xx, xy, yy = self.px_per_mm
        return np.array([[xx, xy], [xy, yy]])

    def to_picture(self, gel_mm: Array) -> Array:
        """Map (..., 2) points of the gel, mm, to the picture, px."""
        ideal = (gel_mm + np.array(self.origin_mm)) @ self.scale
        shift = distorted(ideal, self.k1, self.k2, half_diagonal_px(self.image_shape))
        return np.asarray(np.array(self.centre_px) + shift)

    def to_gel(self, picture_px: Array) -> Array:
        """Map (..., 2) points of the picture, px, to the gel, mm; the inverse of `to_picture`."""
        radius = half_diagonal_px(self.image_shape)
        ideal = undistorted(picture_px - np.array(self.centre_px), self.k1, self.k2, radius)
        return np.asarray(ideal @ np.linalg.inv(self.scale) - np.array(self.origin_mm))

    def jacobian(self, gel_mm: Array) -> Array:
        """Return the (..., 2, 2) derivatives d(picture) / d(gel), px per mm, at (..., 2) points of the gel."""
        ideal = (gel_mm + np.array(self.origin_mm)) @ self.scale
        radius2 = half_diagonal_px(self.image_shape) ** 2
        r2 = ((ideal**2).sum(axis=-1) / radius2)[..., None, None]
        along = ideal[..., :, None] * ideal[..., None, :] / radius2
        radial = np.eye(2) * (1 + self.k1 * r2 + self.k2 * r2**2) + along * (2 * self.k1 + 4 * self.k2 * r2)
        return np.asarray(radial @ self.scale)

    @property
    def mm_per_px(self) -> tuple[float, float]:
        """How far apart two neighbouring pixels are on the gel in the middle of the picture, along (x, y)."""
        inverse = np.linalg.inv(self.jacobian(self.to_gel(middle_px(self.image_shape))))
        x, y = np.linalg.norm(inverse, axis=0)
        return float(x), float(y)

    @property
    def bend_px(self) -> float:
        """How far the distortion moves a corner of the picture against its undistorted place, px, at most."""
        height, width = self.image_shape
        corners = np.array([[x, y] for x in (0, width - 1) for y in (0, height - 1)], np.float64)
        middle = middle_px(self.image_shape)
        straight = middle + self.to_gel(corners) @ self.jacobian(self.to_gel(middle)).T
        return float(np.linalg.norm(straight - corners, axis=1).max())


def middle_px(image_shape: tuple[int, int]) -> Array:
    """(x, y) of the middle of pictures (H, W)."""
    return np.array([(image_shape[1] - 1) / 2, (image_shape[0] - 1) / 2])


def half_diagonal_px(image_shape: tuple[int, int]) -> float:
    """Half the diagonal of pictures (H, W): r is 1 there."""
    return float(np.hypot(*image_shape)) / 2


def distorted(ideal: Array, k1: float, k2: float, radius_px: float) -> Array:
    """Map (..., 2) ideal places, px from the centre of distortion, to where they are seen."""
    r2 = (ideal**2).sum(axis=-1, keepdims=True) / radius_px**2
    return np.asarray(ideal * (1 + k1 * r2 + k2 * r2**2))


def undistorted(seen: Array, k1: float, k2: float, radius_px: float) -> Array:
    """Map (..., 2) seen places, px from the centre of distortion, to their ideal ones: Newton's method."""
    wanted = np.linalg.norm(seen, axis=-1, keepdims=True) / radius_px
    r = wanted.copy()
    for _ in range(_INVERSE_STEPS):
        r -= (r * (1 + k1 * r**2 + k2 * r**4) - wanted) / (1 + 3 * k1 * r**2 + 5 * k2 * r**4)
    return np.asarray(seen * np.divide(r, wanted, out=np.ones_like(r), where=wanted > 0))
