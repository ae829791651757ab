"""From the bytes of a camera's picture to RGB; a picture that is not whole is never returned."""

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.frames.jpeg import CorruptPictureError, decode_jpeg
from gellight.sensor.v4l2.formats import Mode


def decode(data: bytes, mode: Mode) -> NDArray[np.uint8]:
    """Return (H, W, 3) uint8 RGB of a picture taken in `mode`; CorruptPictureError unless it is whole."""
    if mode.letters == "MJPG":
        return decode_jpeg(data, (mode.height, mode.width))
    pixel_bytes = {"YUYV": 2, "RGB3": 3, "GREY": 1}[mode.letters]
    line_bytes = mode.line_bytes or mode.width * pixel_bytes
    if len(data) < line_bytes * mode.height:
        raise CorruptPictureError(f"{len(data)} bytes instead of {line_bytes * mode.height}")
    lines = np.frombuffer(data, np.uint8, line_bytes * mode.height).reshape(mode.height, line_bytes)
    pixels = np.ascontiguousarray(lines[:, : mode.width * pixel_bytes]).reshape(mode.height, mode.width, pixel_bytes)
    if mode.letters == "YUYV":
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_YUV2RGB_YUYV), np.uint8)
    return np.repeat(pixels, 3, axis=2) if mode.letters == "GREY" else pixels.copy()
