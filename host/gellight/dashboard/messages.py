"""The binary WebSocket message that carries one tactile frame to the page.

A message is, in order, all little-endian::

    0   4 bytes   "GELF"
    4   uint32    VERSION
    8   uint32    length of the header in bytes, padding included
    12  header    JSON in UTF-8, padded with spaces so that the planes start at a multiple of 4
    ..  planes    one after the other, each padded with zeros to a multiple of 4

The header names each plane with its offset (from the first plane) and its length. Planes are at view size, at most
320 x 240, reduced by area averaging so that no pixel of the sensor is left out:

    image       JPEG of the camera image, RGB
    difference  (h, w, 3) uint8, grey levels + 128, clipped to -128..127
    normal      (h, w, 2) int8, x and y of the unit normal times 127; z is positive
    depth       (h, w) uint16, (depth in mm + 1) in units of 0.1 micrometre: depths from -1 mm to 5.5534 mm are kept to
                0.05 micrometre, what lies outside is clipped, 65535 means "no depth"
    contact     contact patch, one bit a pixel, rows joined without padding, highest bit first
    truth       like depth: the true depth map. Only a simulated sensor knows it; else the plane is not there

The header's `contacts` are the connected parts of the contact patch, the deepest first: see `frames.Patch`.

Where the truth is known the header's `truth` holds `indentation_mm`, the largest true depth; `depth_error_mm`, the mean
absolute error of the measured depth over the contact (over the whole map where nothing touches); and
`map_depth_error_mm`, the same over the whole map. All three are of the maps at full size; no constant is taken off.
"""

import json
import math
import struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import Patch, TactileFrame
from gellight.reconstruction.contact import measure_patches
from gellight.reconstruction.errors import depth_errors

MAGIC = b"GELF"
VERSION = 1
MOST_CONTACTS = 12
"""the deepest; more are not told apart on a page"""
VIEW_WIDTH_PX = 320
VIEW_HEIGHT_PX = 240
DEPTH_UNIT_MM = 1e-4
DEPTH_OFFSET_MM = 1.0
NO_DEPTH = 65535
NORMAL_UNIT = 1 / 127
DIFFERENCE_OFFSET = 128
JPEG_QUALITY = 92
PREFIX = struct.Struct("<4sII")
ALIGNMENT = 4


def view_shape(image_shape: tuple[int, int]) -> tuple[int, int]:
    """Return (h, w) of the view of an (H, W) image: its proportions, within 320 x 240, never enlarged."""
    height, width = image_shape
    scale = min(VIEW_WIDTH_PX / width, VIEW_HEIGHT_PX / height, 1.0)
    return max(round(height * scale), 1), max(round(width * scale), 1)


def encode(frame: TactileFrame, *, pixel_size_mm: tuple[float, float]) -> bytes:
    """Encode `frame`; `pixel_size_mm` is the (x, y) size of a camera pixel on the gel."""
    shape = view_shape(frame.depth_mm.shape)
    planes = {
        "image": jpeg(_reduce(frame.camera_frame.image, shape)),
        "difference": _encode_difference(frame.difference, shape),
        "normal": _encode_normals(frame.normal_map, shape),
        "depth": _encode_depth(frame.depth_mm, shape),
        "contact": np.packbits(_reduce(frame.contact.mask.astype(np.float32), shape) >= 0.5).tobytes(),
    }
    if (truth := frame.camera_frame.truth) is not None:
        planes["truth"] = _encode_depth(truth.depth_mm, shape)
    header = _header(frame, pixel_size_mm) | {"view_px": [shape[1], shape[0]], "planes": _places(planes)}
    text = _padded(json.dumps(without_nan(header), separators=(",", ":"), allow_nan=False).encode(), PREFIX.size, b" ")
    return b"".join([PREFIX.pack(MAGIC, VERSION, len(text)), text, *(_padded(plane) for plane in planes.values())])


def without_nan(value: object) -> Any:
    """Return `value` with every number that JSON cannot carry replaced by None, all the way down."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): without_nan(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(item) for item in value]
    return value


def _header(frame: TactileFrame, pixel_size_mm: tuple[float, float]) -> dict[str, object]:
    camera_frame, contact = frame.camera_frame, frame.contact
    height, width = frame.depth_mm.shape
    header: dict[str, object] = {
        "sequence": camera_frame.sequence,
        "time_s": camera_frame.time_s,
        "source": camera_frame.source,
        "image_px": [width, height],
        "pixel_size_mm": list(pixel_size_mm),
        "contact": {
            "area_mm2": float(contact.area_mm2),
            "indentation_mm": float(contact.indentation_mm),
            "centroid_mm": None if contact.centroid_mm is None else [float(c) for c in contact.centroid_mm],
        },
        "contacts": [vars(patch) for patch in _patches(frame, pixel_size_mm)],
        "light": None if camera_frame.light is None else camera_frame.light.tolist(),
        "stage_ms": {stage: seconds * 1e3 for stage, seconds in frame.stage_seconds.items()},
        "truth": _truth_figures(frame),
    }
    return header


def _patches(frame: TactileFrame, pixel_size_mm: tuple[float, float]) -> list[Patch]:
    return measure_patches(frame.contact.mask, frame.depth_mm, frame.gradient_map, pixel_size_mm)[:MOST_CONTACTS]


def _truth_figures(frame: TactileFrame) -> dict[str, float] | None:
    truth = frame.camera_frame.truth
    if truth is None:
        return None
    map_error_mm, contact_error_mm = depth_errors(frame, truth)
    return {
        "indentation_mm": float(truth.depth_mm.max()),
        "depth_error_mm": contact_error_mm,
        "map_depth_error_mm": map_error_mm,
    }


def _places(planes: dict[str, bytes]) -> list[dict[str, object]]:
    places, offset = [], 0
    for name, plane in planes.items():
        places.append({"name": name, "offset": offset, "length": len(plane)})
        offset += len(_padded(plane))
    return places


def _padded(block: bytes, start: int = 0, filler: bytes = b"\0") -> bytes:
    return block + filler * (-(start + len(block)) % ALIGNMENT)


def _reduce(plane: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    return np.asarray(cv2.resize(plane, (shape[1], shape[0]), interpolation=cv2.INTER_AREA))


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """Encode an (H, W, 3) RGB image as JPEG."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    return cv2.imencode(".jpg", bgr, options)[1].tobytes()


def _encode_difference(difference: NDArray[np.float32], shape: tuple[int, int]) -> bytes:
    grey = np.rint(_reduce(difference, shape)) + DIFFERENCE_OFFSET
    return bytes(np.clip(grey, 0, 255).astype(np.uint8).tobytes())


def _encode_normals(normal_map: NDArray[np.float32], shape: tuple[int, int]) -> bytes:
    x, y, z = cv2.split(cv2.patchNaNs(_reduce(normal_map.astype(np.float32, copy=False), shape), 0.0))
    scale = 1 / (NORMAL_UNIT * np.sqrt(x * x + y * y + z * z + np.float32(1e-12)))
    codes = np.rint(cv2.merge([x * scale, y * scale])).astype(np.int8)
    return bytes(codes.tobytes())


def _encode_depth(depth_mm: NDArray[np.float32], shape: tuple[int, int]) -> bytes:
    code = np.rint((_reduce(depth_mm, shape) + DEPTH_OFFSET_MM) / DEPTH_UNIT_MM)
    return np.where(np.isfinite(code), np.clip(code, 0, NO_DEPTH - 1), NO_DEPTH).astype("<u2").tobytes()
