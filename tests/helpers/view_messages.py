"""The decoder of the dashboard's messages, which tests them."""

import json
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.dashboard.messages import (
    DEPTH_OFFSET_MM,
    DEPTH_UNIT_MM,
    DIFFERENCE_OFFSET,
    MAGIC,
    NO_DEPTH,
    NORMAL_UNIT,
    PREFIX,
    VERSION,
)


@dataclass(frozen=True, kw_only=True)
class View:
    """A decoded message: the frame as the page sees it, at view size (h, w)."""

    header: dict[str, Any]
    image: NDArray[np.uint8]
    """(h, w, 3) RGB"""
    difference: NDArray[np.float32]
    """(h, w, 3) grey levels"""
    normal_map: NDArray[np.float32]
    """(h, w, 3) unit normals"""
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
    truth = planes.get("truth")
    bits = np.unpackbits(np.frombuffer(planes["contact"], np.uint8), count=height * width)
    return View(
        header=header,
        image=_decode_image(planes["image"]),
        difference=_plane(planes["difference"], np.uint8, (height, width, 3)) - np.float32(DIFFERENCE_OFFSET),
        normal_map=_decode_normals(_plane(planes["normal"], np.int8, (height, width, 2))),
        depth_mm=_decode_depth(_plane(planes["depth"], np.uint16, (height, width))),
        contact=bits.reshape(height, width).astype(bool),
        truth_mm=None if truth is None else _decode_depth(_plane(truth, np.uint16, (height, width))),
    )


def _decode_image(jpeg: bytes) -> NDArray[np.uint8]:
    bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError("the image of the message is not a JPEG")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def _decode_normals(codes: NDArray[np.int8]) -> NDArray[np.float32]:
    xy = codes * np.float32(NORMAL_UNIT)
    z = np.sqrt(np.maximum(1 - (xy**2).sum(axis=2, keepdims=True), 0))
    return np.concatenate([xy, z], axis=2)


def _decode_depth(codes: NDArray[np.uint16]) -> NDArray[np.float32]:
    depth = codes.astype(np.float32) * np.float32(DEPTH_UNIT_MM) - np.float32(DEPTH_OFFSET_MM)
    return np.where(codes == NO_DEPTH, np.float32(np.nan), depth)


def _plane(block: bytes, dtype: type[np.generic], shape: tuple[int, ...]) -> NDArray[Any]:
    return np.frombuffer(block, np.dtype(dtype).newbyteorder("<")).reshape(shape)
