"""The gradient map of a distorted picture to that of the gel: square pixels of the bundle's size, slopes in mm per mm.

The lens is taken out after the network, not out of the picture before it. GelNet answers pixel by pixel, so it does not
mind where on the gel a pixel is; the network of the bundle, its presses, its reference image and the mask stay valid
as they are, and two channels are resampled instead of three pictures.

What a slope of the network means depends on what it learnt from. Contact circles of a ball of radius R, drawn in the
picture, say of a pixel u that its normal leans by n = p (u - c) / R, p being the pixel size of the bundle; in truth it
leans by (X(u) - X(c)) / R = J (u - c) / R, with J = dX/du. So the truth is J n / p, which is what comes out. A network
that learnt true slopes (as that of the simulated sensor) needs no such step.
"""

from typing import Annotated, Any, ClassVar, TypeVar, cast

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import AwareDatetime, Field, FiniteFloat

from gellight.base.allowed import Positive
from gellight.bundle.bundle import Bundle
from gellight.bundle.bundle_file import PictureFile
from gellight.frames.pixel_grid import bounding_box, gel_points_mm
from gellight.reconstruction.lens.model import Lens

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
Image = TypeVar("Image", bound=NDArray[Any])

_STEEPEST = 0.995
"""sine: a normal that the lens would lean beyond 84 degrees is left there"""


class Undistortion:
    """The resampling of one lens, prepared once."""

    def __init__(self, lens: Lens, pixel_size_mm: tuple[float, float], *, from_circles: bool) -> None:
        """Prepare maps for pixels of (x, y) mm about the middle of the picture.

        from_circles: the network learnt from contact circles drawn in the distorted picture.
        """
        gel = gel_points_mm(lens.image_shape, pixel_size_mm)
        places = lens.to_picture(gel).astype(np.float32)
        height, width = lens.image_shape
        self.seen: Bools = np.all((places >= -0.5) & (places <= (width - 0.5, height - 0.5)), axis=-1)
        """(H, W) what lies in the picture, half of an outermost pixel included; elsewhere slopes and depth are 0"""
        self._x, self._y = np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1])
        turn = np.linalg.inv(lens.jacobian(gel)) / np.array(pixel_size_mm)
        self._turn = np.ascontiguousarray(np.moveaxis(turn, (-2, -1), (0, 1)), np.float32) if from_circles else None

    def apply(self, gradient_map: Floats, touched: Bools) -> tuple[Floats, Bools]:
        """Map (H, W, 2) slopes over the picture, and where it is touched, to the same over the gel.

        Half-way between pixels linear interpolation takes 2.7 % off the height of a contact of sigma 3 px; the cubic of
        OpenCV adds 1.1 %, that of Lanczos takes 0.1 %, is slow, and serves where the gel is touched. Elsewhere slopes
        are gentle. What is not seen is not touched.
        """
        moved_touch = cv2.remap(touched.astype(np.uint8), self._x, self._y, cv2.INTER_NEAREST)
        moved = self._resampled(gradient_map, (slice(None), slice(None)), cv2.INTER_LINEAR)
        if moved_touch.any():
            part = bounding_box(moved_touch.view(np.bool_))
            moved[part] = self._resampled(gradient_map, part, cv2.INTER_LANCZOS4)
        if self._turn is not None:
            moved = _leaning(moved, self._turn)
        if not self.seen.all():
            moved[~self.seen] = 0
        return moved, np.asarray(moved_touch, np.bool_)

    def picture(self, image: Image) -> Image:
        """Return (H, W, 3) grey levels over the picture as the same over the gel, each from the nearest pixel."""
        return cast("Image", cv2.remap(image, self._x, self._y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE))

    def _resampled(self, gradient_map: Floats, part: tuple[slice, slice], how: int) -> Floats:
        x, y = self._x[part], self._y[part]
        return np.asarray(cv2.remap(gradient_map, x, y, how, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _leaning(slopes: Floats, turn: Floats) -> Floats:
    """Multiply the horizontal parts of the unit normals of (H, W, 2) slopes by matrices (2, 2, H, W)."""
    gx, gy = slopes[..., 0], slopes[..., 1]
    x, y = turn[0, 0] * gx + turn[0, 1] * gy, turn[1, 0] * gx + turn[1, 1] * gy
    # With n = g / sqrt(1 + g^2) and m = turn n, the slope m / sqrt(1 - m^2) is turn g / sqrt(1 + g^2 - (turn g)^2).
    length2 = 1 + gx * gx + gy * gy
    scale = 1 / np.sqrt(np.maximum(length2 - x * x - y * y, (1 - _STEEPEST**2) * length2))
    return np.stack([x * scale, y * scale], axis=-1)


FILE_NAME = "lens.json"
REMEDY = "measure it again with `gellight calibrate lens IMAGE --pitch-mm P --calibration BUNDLE --out NEW`"


class LensRecord(PictureFile):
    """The content of the file; the first five as in `Lens`."""

    file_name: ClassVar[str] = FILE_NAME
    remedy: ClassVar[str] = REMEDY
    centre_px: tuple[FiniteFloat, FiniteFloat]
    k1: Annotated[float, Field(gt=-1, lt=1)]
    k2: Annotated[float, Field(gt=-1, lt=1)]
    px_per_mm: tuple[Positive, FiniteFloat, Positive]
    origin_mm: tuple[FiniteFloat, FiniteFloat]
    learnt_from_circles: bool
    """the network of the bundle learnt from contact circles in the distorted picture; else from true slopes"""
    pitch_mm: Positive
    images: tuple[str, ...]
    pins: Annotated[int, Field(ge=1)]
    rms_before_px: Annotated[float, Field(ge=0)]
    rms_after_px: Annotated[float, Field(ge=0)]
    created: AwareDatetime


def has_lens(bundle: Bundle) -> bool:
    """Tell whether the bundle knows its lens."""
    return FILE_NAME in bundle.files


def read_undistortion(bundle: Bundle) -> Undistortion | None:
    """Return the resampling of a bundle, None without a lens; BundleError as `LensRecord.in_bundle`."""
    record = LensRecord.in_bundle(bundle)
    if record is None:
        return None
    return Undistortion(lens_of(record), bundle.pixel_size_mm, from_circles=record.learnt_from_circles)


def lens_of(record: LensRecord) -> Lens:
    """Return the lens of a record."""
    return Lens(
        image_shape=(record.image_height_px, record.image_width_px),
        centre_px=record.centre_px,
        k1=record.k1,
        k2=record.k2,
        px_per_mm=record.px_per_mm,
        origin_mm=record.origin_mm,
    )
