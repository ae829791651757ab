"""Planes at view size: what the page shows of a frame, and how a plane is packed into few bytes."""

import hashlib
import zlib

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame
from gellight.frames.pixel_grid import area_means

VIEW_WIDTH_PX = 320  # chosen: half of 640 x 480; so a frame with its true depth has 40 kB (BALL, 1 mm)
VIEW_HEIGHT_PX = 240  # chosen, with the width
DEPTH_UNIT_MM = 5e-4  # chosen: 16 bits then reach to 31.767 mm, and rounding is 0.25 um at most
DEPTH_OFFSET_MM = 1.0  # chosen: gel that bulges has a depth below 0
NO_DEPTH = 65535  # the largest of 16 bits
JPEG_QUALITY = 92  # measured: pictures are off by 0.6 grey levels on average
FULL_COLOUR = 0x111111
"""of IMWRITE_JPEG_SAMPLING_FACTOR: a colour for each pixel; a colour for four would blur the rims in the difference"""
RAW_DEFLATE = -15  # zlib's manual: no header, a window of 2^15 bytes; browsers name it deflate-raw


def view_shape(image_shape: tuple[int, ...]) -> tuple[int, int]:
    """Return (h, w) of the view of an (H, W) image: its proportions, within 320 x 240, never enlarged."""
    height, width = image_shape
    scale = min(VIEW_WIDTH_PX / width, VIEW_HEIGHT_PX / height, 1.0)
    return max(round(height * scale), 1), max(round(width * scale), 1)


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """Encode an (H, W, 3) RGB image as JPEG."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, FULL_COLOUR]
    return cv2.imencode(".jpg", bgr, options)[1].tobytes()


def webp(image: NDArray[np.float32]) -> bytes:
    """Encode a (h, w, 3) RGB image, rounded to grey levels, as WebP without loss."""
    rounded = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    without_loss = [cv2.IMWRITE_WEBP_QUALITY, 101]
    return cv2.imencode(".webp", cv2.cvtColor(rounded, cv2.COLOR_RGB2BGR), without_loss)[1].tobytes()


def pack_depth(depth_mm: NDArray[np.float32], shape: tuple[int, int]) -> bytes:
    """Pack a depth map at view size: codes, their differences from the neighbours, deflated.

    Each code is replaced by its difference from the code to the left, and that by its difference from the row above;
    both modulo 65536, so that nothing is lost. Small numbers of either sign become small ones without sign (0, -1, 1,
    -2 are 0, 1, 2, 3). All low bytes come first, then all high bytes, which are nearly all 0.
    """
    code = np.rint((area_means(depth_mm, shape) + DEPTH_OFFSET_MM) / DEPTH_UNIT_MM)
    codes = np.where(np.isfinite(code), np.clip(code, 0, NO_DEPTH - 1), NO_DEPTH).astype(np.uint16)
    steps = np.diff(codes, axis=1, prepend=np.uint16(0))
    steps = np.diff(steps, axis=0, prepend=np.uint16(0)).view(np.int16)
    small = ((steps << 1) ^ (steps >> 15)).view(np.uint16)
    return deflate((small & 0xFF).astype(np.uint8).tobytes() + (small >> 8).astype(np.uint8).tobytes())


def pack_contact(mask: NDArray[np.bool_], shape: tuple[int, int]) -> bytes:
    """Pack a contact patch at view size, one bit a pixel, highest bit first, deflated."""
    return deflate(np.packbits(area_means(mask.astype(np.float32), shape) >= 0.5).tobytes())


def deflate(block: bytes) -> bytes:
    """Compress as raw deflate. Runs only: on depth maps smaller and eight times as fast as a search for repetitions."""
    packer = zlib.compressobj(9, zlib.DEFLATED, RAW_DEFLATE, 9, zlib.Z_RLE)
    return packer.compress(block) + packer.flush()


SAMPLE_PX = 8
"""every eighth pixel of every eighth row tells whether the reference image is still the same"""
SAME_GREY = 0.25  # chosen: half of what rounding to whole grey levels hides
REFRESH_S = 1.0
"""light that changes evenly over the view, and is followed, is no new reference image more often than this"""
KEPT = 4
"""reference images that are kept for pages that ask late"""


class ReferenceViews:
    """The reference images of the frames that were shown last, at view size."""

    def __init__(self) -> None:
        """Know none yet."""
        self._pictures: dict[str, bytes] = {}
        self._name = ""
        self._sample: NDArray[np.float32] | None = None
        self._kept_s = 0.0

    def of(self, frame: TactileFrame) -> tuple[str, list[float]]:
        """Return the name of the reference image of `frame`, and its (3,) light drift in grey levels.

        The difference image is the camera image minus the reference image minus the drift; for up to `REFRESH_S` but
        for light that has changed evenly.
        """
        sample = frame.camera_frame.image[::SAMPLE_PX, ::SAMPLE_PX] - frame.difference[::SAMPLE_PX, ::SAMPLE_PX]
        if self._sample is not None and self._sample.shape == sample.shape:
            change = sample - self._sample
            drift = np.median(change.reshape(-1, 3), axis=0)
            new = frame.camera_frame.time_s - self._kept_s >= REFRESH_S
            if np.abs(change - (drift if new else _even(change, self._sample))).max() <= SAME_GREY:
                return self._name, [round(float(grey), 3) for grey in drift]
        self._sample, self._kept_s = sample, frame.camera_frame.time_s
        self._name = self._keep(frame)
        return self._name, [0.0, 0.0, 0.0]

    def picture(self, name: str) -> bytes:
        """Return the reference image `name` as WebP without loss; InputError where it is not kept any more."""
        try:
            return self._pictures[name]
        except KeyError:
            raise InputError(f"no reference image {name!r}: take the name from the newest frame") from None

    def _keep(self, frame: TactileFrame) -> str:
        reference = frame.camera_frame.image.astype(np.float32) - frame.difference
        picture = webp(area_means(reference, view_shape(frame.depth_mm.shape)))
        name = hashlib.sha256(picture).hexdigest()[:16]
        self._pictures.pop(name, None)
        self._pictures[name] = picture
        while len(self._pictures) > KEPT:
            self._pictures.pop(next(iter(self._pictures)))
        return name


def _even(change: NDArray[np.float32], sample: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the part of an (H, W, 3) change that is the sample times a plane over the view, by least squares."""
    height, width, _ = change.shape
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    plane = np.stack([np.ones_like(x), x, y], axis=-1)
    even = np.empty_like(change)
    for channel in range(3):
        terms = (plane * sample[..., channel, None]).reshape(-1, 3)
        weights, *_ = np.linalg.lstsq(terms, change[..., channel].ravel(), rcond=None)
        even[..., channel] = (terms @ weights).reshape(height, width)
    return even
