"""The binary WebSocket message that carries one tactile frame to the page.

A message is, in order, all little-endian::

    0   4 bytes   "GELF"
    4   uint32    VERSION
    8   uint32    length of the header in bytes
    12  header    JSON in UTF-8
    ..  planes    one after the other

The header names each plane with its offset (from the first plane) and its length. Planes are at view size, at most
320 x 240, reduced by area averaging so that no pixel of the sensor is left out:

    image       JPEG of the camera image, RGB
    depth       (h, w) depth map, (depth in mm + 1) in units of 0.5 micrometre: depths from -1 mm to 31.767 mm are kept
                to 0.25 micrometre, what lies outside is clipped, 65535 means "no depth"; packed as `pack_depth` says
    contact     contact patch, one bit a pixel, rows joined without padding, highest bit first; raw deflate
    truth       like depth: the true depth map. Only a simulated sensor knows it; else the plane is not there

The header's `contacts` are the connected parts of the contact patch, the deepest first: see `frames.Patch`. Its `force`
holds `normal_n`, `error_n` and `flags` (see `measures.Force`), or is null where the bundle has no constant for it. Its
`shear` is null for a gel without marker dots; else it holds `force_n`, `force_error_n`, `torque_nmm` and `unknown` (see
`shear.Shear`), `slip`, the state of `shear.Slip`, and `arrows`: x, y of each dot that is seen, mm from the image
centre, and x, y by which it has moved. Its `pose` has the object's `number`, whether it is `lost`, a `text`, and x and
y of the axes that move with it and of the `place_mm` where they begin; null where nothing is tracked.

The page makes the rest itself. The difference image is the image minus the reference image, which the header names
(`reference`) and the page fetches once, minus the header's `light_drift`. Slopes and normals are those of the depth
map, by central differences.

Where the truth is known the header's `truth` holds `indentation_mm`, the largest true depth; `depth_error_mm`, the mean
absolute error of the measured depth over the contact (over the whole map where nothing touches); and
`map_depth_error_mm`, the same over the whole map. All three are of the maps at full size; no constant is taken off.
"""

import json
import math
import struct
from typing import Any

import numpy as np

from gellight.dashboard.view import ReferenceViews, jpeg, pack_contact, pack_depth, view_shape
from gellight.frames.frames import GroundTruth, TactileFrame
from gellight.frames.pixel_grid import area_means
from gellight.frames.pose import ObjectPose
from gellight.reconstruction.errors import depth_errors

MAGIC = b"GELF"
VERSION = 2  # counted up when this layout changes
MOST_CONTACTS = 12
"""the deepest; more are not told apart on a page"""
PREFIX = struct.Struct("<4sII")


def encode(frame: TactileFrame, *, pixel_size_mm: tuple[float, float], references: ReferenceViews) -> bytes:
    """Encode `frame`; `pixel_size_mm` is the (x, y) size of a camera pixel on the gel.

    `references` knows the reference image of the frame afterwards.
    """
    truth, shape = frame.camera_frame.truth, view_shape(frame.depth_mm.shape)
    planes = {
        "image": jpeg(area_means(frame.camera_frame.image, shape)),
        "depth": pack_depth(frame.depth_mm, shape),
        "contact": pack_contact(frame.contact.mask, shape),
    }
    if truth is not None:
        planes["truth"] = pack_depth(truth.depth_mm, shape)
    reference, drift = references.of(frame)
    header = _header(frame, pixel_size_mm) | {
        "truth": _truth_figures(frame, truth) if truth else None,
        "reference": reference,
        "light_drift": drift,
        "view_px": [shape[1], shape[0]],
        "planes": _places(planes),
    }
    text = json.dumps(without_nan(header), separators=(",", ":"), allow_nan=False).encode()
    return b"".join([PREFIX.pack(MAGIC, VERSION, len(text)), text, *planes.values()])


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
        "force": frame.force.as_json() if frame.force else None,
        "pose": _pose(frame.pose) if frame.pose else None,
        "shear": _shear(frame, pixel_size_mm),
        "contacts": [vars(patch) for patch in frame.contacts[:MOST_CONTACTS]],
        "light": None if camera_frame.light is None else camera_frame.light.tolist(),
        "stage_ms": {stage: seconds * 1e3 for stage, seconds in frame.stage_seconds.items()},
    }
    return header


def _pose(pose: ObjectPose) -> dict[str, object]:
    """Return the axes that move with the object, seen from the camera, and where they begin."""
    return {
        "number": pose.number,
        "lost": pose.lost,
        "text": pose.in_words(),
        "place_mm": pose.place_mm[:2].tolist(),
        "axes": pose.motion[:2, :3].T.tolist(),
    }


def _shear(frame: TactileFrame, pixel_size_mm: tuple[float, float]) -> dict[str, object] | None:
    shear = frame.shear
    if shear is None:
        return None
    height, width = frame.depth_mm.shape
    places = (shear.dots.places_px - np.array([width - 1, height - 1]) / 2) * np.array(pixel_size_mm)
    arrows = np.concatenate([places, shear.field_mm], axis=1)[~np.isnan(shear.field_mm[:, 0])]
    return {
        "force_n": shear.force_n,
        "force_error_n": shear.force_error_n,
        "torque_nmm": shear.torque_nmm,
        "centre_mm": shear.centre_mm,
        "unknown": shear.unknown,
        "slip": frame.slip.state if frame.slip else None,
        "arrows": np.round(arrows, 3).tolist(),
    }


def _truth_figures(frame: TactileFrame, truth: GroundTruth) -> dict[str, float]:
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
        offset += len(plane)
    return places
