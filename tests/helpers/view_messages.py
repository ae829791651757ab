"""The decoder of the dashboard's messages, which tests them."""

import json
import zlib
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.dashboard.messages import MAGIC, PREFIX, VERSION
from gellight.dashboard.view import DEPTH_OFFSET_MM, DEPTH_UNIT_MM, NO_DEPTH, RAW_DEFLATE


@dataclass(frozen=True, kw_only=True)
class View:
    """A decoded message: the frame as the page sees it, at view size (h, w)."""

    header: dict[str, Any]
    image: NDArray[np.uint8]
    """(h, w, 3) RGB"""
    depth_mm: NDArray[np.float32]
    """(h, w) mm, NaN where there is no depth"""
    contact: NDArray[np.bool_]
    """(h, w)"""
    truth_mm: NDArray[np.float32] | None
    """(h, w) mm, the true depth map; None where it is not known"""


def decode(message: bytes) -> View:
    """Decode what `encode` wrote; ValueError where it is not such a message."""
    magic, version, header_length = PREFIX.unpack_from(message)
    if magic != MAGIC or version != VERSION:
        raise ValueError(f"not a tactile frame of version {VERSION}: it starts with {magic!r}, version {version}")
    start = PREFIX.size + header_length
    header = json.loads(message[PREFIX.size : start])
    planes = {
        plane["name"]: message[start + plane["offset"] : start + plane["offset"] + plane["length"]]
        for plane in header["planes"]
    }
    width, height = header["view_px"]
    bits = np.unpackbits(np.frombuffer(inflate(planes["contact"]), np.uint8), count=height * width)
    truth = planes.get("truth")
    return View(
        header=header,
        image=decode_image(planes["image"]),
        depth_mm=_decode_depth(planes["depth"], height, width),
        contact=bits.reshape(height, width).astype(bool),
        truth_mm=None if truth is None else _decode_depth(truth, height, width),
    )


def inflate(plane: bytes) -> bytes:
    return zlib.decompress(plane, RAW_DEFLATE)


def decode_image(file: bytes) -> NDArray[np.uint8]:
    """Decode a JPEG or WebP as RGB."""
    bgr = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError("that is no picture")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def _decode_depth(plane: bytes, height: int, width: int) -> NDArray[np.float32]:
    low, high = np.frombuffer(inflate(plane), np.uint8).reshape(2, height, width).astype(np.int64)
    small = low + 256 * high
    steps = np.where(small % 2 == 0, small // 2, -(small // 2) - 1)
    codes = np.cumsum(np.cumsum(steps, axis=0), axis=1) % 65536
    depth = codes.astype(np.float32) * np.float32(DEPTH_UNIT_MM) - np.float32(DEPTH_OFFSET_MM)
    return np.where(codes == NO_DEPTH, np.float32(np.nan), depth)
