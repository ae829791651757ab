"""From the bytes of a picture to RGB, by OpenCV; a picture that is not whole is never returned.

OpenCV reports a JPEG that breaks off only on standard error and returns a picture all the same. What its decoder could
not fill it leaves at exactly mid-grey, and a JPEG that lost bytes anywhere runs out of data before the last block; so
the last block of the picture tells.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.v4l2.formats import Mode

Image = NDArray[np.uint8]

_START, _END = b"\xff\xd8", b"\xff\xd9"
_FLAGS = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
_BLOCK_PX = 8
_UNFILLED = 128
_FILLING_BYTES = 4096
"""some cameras fill their last packet with anything"""


class CorruptPictureError(ValueError):
    """A picture is not whole; the text says how."""


def decode(data: bytes, mode: Mode) -> Image:
    """Return (H, W, 3) RGB of a picture taken in `mode`; CorruptPictureError unless it is whole."""
    if mode.letters == "MJPG":
        return _decode_jpeg(data, mode)
    pixel_bytes = {"YUYV": 2, "RGB3": 3, "GREY": 1}[mode.letters]
    line_bytes = mode.line_bytes or mode.width * pixel_bytes
    if len(data) < line_bytes * mode.height:
        raise CorruptPictureError(f"{len(data)} bytes instead of {line_bytes * mode.height}")
    lines = np.frombuffer(data, np.uint8, line_bytes * mode.height).reshape(mode.height, line_bytes)
    pixels = np.ascontiguousarray(lines[:, : mode.width * pixel_bytes]).reshape(mode.height, mode.width, pixel_bytes)
    if mode.letters == "YUYV":
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_YUV2RGB_YUYV), np.uint8)
    return np.repeat(pixels, 3, axis=2) if mode.letters == "GREY" else pixels.copy()


def _decode_jpeg(data: bytes, mode: Mode) -> Image:
    end = data.rfind(_END, -_FILLING_BYTES)
    if not data.startswith(_START) or end < 0:
        raise CorruptPictureError("a JPEG without its start or its end")
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8, end + len(_END)), _FLAGS)
    except cv2.error as error:
        raise CorruptPictureError(str(error)) from error
    if image is None or image.shape != (mode.height, mode.width, 3):
        raise CorruptPictureError(f"a JPEG of shape {None if image is None else image.shape}")
    if (image[-_BLOCK_PX:, -_BLOCK_PX:] == _UNFILLED).all():
        raise CorruptPictureError("a JPEG that breaks off")
    return np.asarray(image, np.uint8)
