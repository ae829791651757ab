"""From RGB pictures to what a camera sends: MJPG and YUYV.

Every JPEG carries, in a comment segment, its number and when its exposure began: the truth that a test compares with
what the host believes. Other programs skip the segment.
"""

import struct
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError

QUALITY = 95
_START, _COMMENT = b"\xff\xd8", b"\xff\xfe"
_MARK = struct.Struct(">8sIdI")
_TAG = b"gellight"


class Mark(NamedTuple):
    """The truth about a picture, in a comment segment of its JPEG."""

    number: int
    """counts the pictures that the camera took since power-on"""
    time_s: float
    """start of the exposure on the camera's `time.monotonic`"""
    exposure_us: int
    """that it was taken with"""


def to_jpeg(image: NDArray[np.uint8], mark: Mark) -> bytes:
    """Compress (H, W, 3) uint8 RGB, colours halved across as cameras do (4:2:2), and mark it."""
    options = [cv2.IMWRITE_JPEG_QUALITY, QUALITY, cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
               cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422]  # fmt: skip
    _, code = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), options)
    body = _MARK.pack(_TAG, *mark)
    return _START + _COMMENT + struct.pack(">H", len(body) + 2) + body + code.tobytes()[2:]


def read_mark(jpeg: bytes) -> Mark:
    """Return what `to_jpeg` wrote; InputError for a JPEG of another camera."""
    if len(jpeg) < 6 + _MARK.size or jpeg[2:4] != _COMMENT or jpeg[6 : 6 + len(_TAG)] != _TAG:
        raise InputError("the picture carries no mark of a virtual sensor: it is of another camera, or cut off")
    _, *values = _MARK.unpack_from(jpeg, 6)
    return Mark(*values)


def to_yuyv(image: NDArray[np.uint8]) -> bytes:
    """Convert (H, W, 3) uint8 RGB, W even, to two bytes a pixel (BT.601, limited range)."""
    return cv2.cvtColor(image, cv2.COLOR_RGB2YUV_YUY2).tobytes()


def binned(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Average blocks of pixels so that the picture gets (width, height)."""
    if image.shape[1::-1] == size:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
