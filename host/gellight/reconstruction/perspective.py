"""Slopes and depth as a camera above the gel sees them, and back.

A camera at the height H above the gel at rest sees the gel that is d deep at x in the pixel p, x = p (1 - d / H), both
from its axis. With the distance Z = H - d to the camera, the slopes g = d(depth)/dx of the gel give the gradient of
ln Z over the picture (Queau, Durou, Aujol: Normal integration: a survey, J. Math. Imaging and Vision 60, 2018):

    q = -H grad_p ln Z = g / (1 + p . g / H),    so with L = integral of q:   d = H (1 - exp(-L / H)).

So the same integrator runs on the slopes q. The other way g = q / (1 - p . q / H).
"""

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.pixel_grid import gel_points_mm
from gellight.reconstruction.integration import integrate
from gellight.reconstruction.smoothing import Smoother

Array = NDArray[np.floating]
Floats = NDArray[np.float32]
Size = tuple[float, float]


class Perspective:
    """The view of one camera above the gel."""

    def __init__(self, x_mm: Array, y_mm: Array, height_mm: float) -> None:
        """Keep p / H of pixels at x_mm (W,), y_mm (H,) from the axis. height_mm: H, as it seems from within the gel."""
        self.x: Floats = np.asarray(x_mm / height_mm, np.float32)
        self.y: Floats = np.asarray(y_mm / height_mm, np.float32)
        self.height_mm = np.float32(height_mm)

    @classmethod
    def of_bundle(cls, bundle: Bundle, block_px: int = 1) -> Self | None:
        """Return that of a bundle, over squares of `block_px`; None where nobody told the height: for parallel rays."""
        (x_mm, y_mm), (height, width) = bundle.pixel_size_mm, (side // block_px for side in bundle.image_shape)
        return cls.over((height, width), (x_mm * block_px, y_mm * block_px), bundle.manifest.camera_height_mm)

    @classmethod
    def over(cls, shape: tuple[int, int], pixel_size_mm: tuple[float, float], height_mm: float) -> Self | None:
        """Return that of (H, W) pixels; None for a height of 0, which nobody told."""
        points = gel_points_mm(shape, pixel_size_mm)
        return cls(points[0, :, 0], points[:, 0, 1], height_mm) if height_mm else None

    def seen(self, slopes: Floats) -> Floats:
        """Return the slopes q of L over the picture, (H, W, 2), for the slopes of the gel."""
        return np.asarray(slopes / (1 + self._along(slopes)), np.float32)

    def slopes(self, seen: Floats) -> Floats:
        """Return the slopes of the gel for the slopes q over the picture, (H, W, 2)."""
        return np.asarray(seen / (1 - self._along(seen)), np.float32)

    def depth_mm(self, logarithmic: Floats) -> Floats:
        """Return the depth of the gel for L, mm."""
        return np.asarray(-self.height_mm * np.expm1(-logarithmic / self.height_mm), np.float32)

    def logarithmic(self, depth_mm: Floats) -> Floats:
        """Return L for the depth of the gel."""
        return np.asarray(-self.height_mm * np.log1p(-depth_mm / self.height_mm), np.float32)

    def sums(
        self, depth_mm: Floats, slopes: Floats, at: tuple[NDArray[np.intp], NDArray[np.intp]], shape: tuple[int, ...]
    ) -> tuple[float, float, float, float]:
        """Return how many pixels of gel at rest are as large as some pixels, and sums of their columns, rows, depths.

        depth_mm: (N,). slopes: (N, 2) of the gel. at: columns and rows of the pixels in a picture of a shape. A pixel
        shows (1 - d / H)^2 / (1 + p . g / H) as much gel as at rest: the determinant of dx / dp for x = p (1 - d / H).
        """
        share = 1 - depth_mm.astype(np.float64) / self.height_mm
        pixels = share**2 / (1 + self.x[at[0]] * slopes[:, 0] + self.y[at[1]] * slopes[:, 1])
        middles = [(side - 1) / 2 for side in shape[1::-1]]
        columns, rows = (float((pixels * (m + share * (n - m))).sum()) for m, n in zip(middles, at, strict=True))
        return float(pixels.sum()), columns, rows, float((pixels * depth_mm).sum())

    def _along(self, slopes: Floats) -> Floats:
        return np.asarray(slopes[..., :1] * self.x[:, None] + slopes[..., 1:] * self.y[:, None, None], np.float32)


def depth_seen(slopes: Floats, size_mm: Size, seen: Perspective | None, **how: Any) -> Floats:
    """Return the depth (H, W), mm, of slopes (H, W, 2) of the gel; seen: None along parallel rays. how: `integrate`."""
    depth = integrate(seen.seen(slopes) if seen else slopes, size_mm, **how).astype(np.float32, copy=False)
    return seen.depth_mm(depth) if seen else depth


def surface_seen(
    smoother: Smoother, depth_mm: Floats, size_mm: Size, measured: Floats, noise: Floats, seen: Perspective | None
) -> Floats:
    """Return the slopes of the gel (H, W, 2): `Smoother.of_surface`, of what is seen along parallel rays where None."""
    over = (depth_mm, measured) if seen is None else (seen.logarithmic(depth_mm), seen.seen(measured))
    slopes = smoother.of_surface(over[0], size_mm, over[1], noise)
    return slopes if seen is None else seen.slopes(slopes)
