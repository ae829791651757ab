"""The message that carries one tactile frame to other programs; docs/wire-format.md describes it.

Little-endian throughout. All maps of a frame travel in one message, so that they always belong together.
"""

import struct
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import cached_property
from math import isnan, nan
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AliasChoices, Field, TypeAdapter

from gellight.base.allowed import MOST_SIDE_PX, Byte, StrictModel, explained
from gellight.base.errors import StreamError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import (
    CameraFrame,
    Contact,
    ExposureFigures,
    ExposureReport,
    LightLabel,
    Patch,
    Provenance,
    TactileFrame,
)
from gellight.frames.measures import Confidence, Force, ForceFigures, MapOnRequest
from gellight.frames.pose import ObjectPose, PoseFigures
from gellight.frames.shear import DotFigures, DotsSeen, Shear, ShearFigures, Slip
from gellight.reconstruction.light_drift import difference_of
from gellight.reconstruction.measures import BundleMeasures

MAGIC = b"GELT"
VERSION = 1  # counted up when this layout changes
PREFIX = struct.Struct("<4sHHIIqddIIdddddd")
"""magic, version, planes, place and length of the details, sequence, time_s, unix_s, width, height, pixel size x and y,
indentation, area, centroid x and y (NaN where nothing touches)"""
PLANE = struct.Struct("<16sIIQ")
"""name, type, channels, place"""
TYPES: dict[int, np.dtype[Any]] = {1: np.dtype(np.uint8), 2: np.dtype("<f4")}
ALIGNMENT = 16  # chosen: of planes: enough for every type and for vectors of 128 bits
MOST_DETAILS, MOST_PLANES = 1 << 20, 16  # chosen: bytes of JSON, 5000 dots too; more planes than there are kinds
CHANNELS = {
    "image": (1, 3),
    "gradient": (2, 2),
    "depth_mm": (2, 1),
    "contact": (1, 1),
    "lights": (1, 1),
    "moving": (1, 1),
    "pressure_mpa": (2, 1),
    "confidence": (2, 1),
    "quality_flags": (1, 1),
}
"""type and channels of each plane by its name; a reader passes over names it does not know"""
NOW_CALLED = {"doubts": "quality_flags"}
"""planes of older senders"""
NEEDED = ("image", "gradient", "depth_mm", "contact")
REMEDY = "update GelLight on both sides to the same version"


class Details(StrictModel):
    """What the prefix leaves out, as JSON."""

    source: str
    light: tuple[tuple[Byte, Byte, Byte], ...] | None
    label: LightLabel | None
    stage_seconds: dict[str, float]
    exposures: ExposureFigures | None
    """the maps of an `ExposureReport` travel as the planes `lights` and `moving`"""
    force: ForceFigures | None = None
    """the map is a plane on request; else the reader computes it from depth and bundle"""
    dots: DotFigures | None = None
    shear: ShearFigures | None = None
    slip: Slip | None = None
    contacts: tuple[Patch, ...] = ()
    pose: PoseFigures | None = None
    from_network: bool | None = Field(None, validation_alias=AliasChoices("from_network", "learnt"))
    """`FrameMeasures.from_network`; None for a frame without measures, as one under another light"""
    provenance: Provenance


_DETAILS = TypeAdapter(Details)


class ReceivedFrame(TactileFrame):
    """A tactile frame from another process. Its arrays cannot be written.

    What needs the bundle is computed when it is first asked for: the difference image, and the
    pressure map and the confidence where they do not travel. The bundle is fetched from the daemon, once for each zero;
    StreamError where the zero has changed since the frame was taken.
    """

    def __init__(self, bundle_of: Callable[[str], Bundle], fields: Mapping[str, Any]) -> None:
        """Take the fields that travel; `bundle_of` returns the bundle with the zero of an identity."""
        vars(self).update(fields, _bundle_of=bundle_of)

    @cached_property
    def difference(self) -> NDArray[np.float32]:
        """(H, W, 3) image minus reference image, grey levels."""
        assert self.provenance is not None
        bundle = vars(self)["_bundle_of"](self.provenance.zero)
        image = self.camera_frame.image
        return difference_of(image, bundle.reference, follow_light=bundle.manifest.follow_light)

    @cached_property
    def measures(self) -> BundleMeasures | None:
        """Computes what does not travel, such as the pressure map, from the maps and the bundle."""
        assert self.provenance is not None
        from_network = vars(self)["_from_network"]
        if from_network is None:
            return None
        return BundleMeasures(vars(self)["_bundle_of"](self.provenance.zero), from_network=from_network)


def encode(frame: TactileFrame, asked: Collection[MapOnRequest] = ()) -> bytes:
    """Return the message of a frame that a daemon delivered; StreamError for one that has no provenance.

    asked: maps that are to travel too, where the frame has them.
    """
    return b"".join(encoded(frame, asked))


def encoded(frame: TactileFrame, asked: Collection[MapOnRequest] = ()) -> list[bytes | memoryview]:
    """Return the message in pieces, of which the planes are the frame's own memory; see `encode`."""
    if frame.provenance is None:
        raise StreamError("a frame without provenance cannot be published: take it from a daemon")
    planes = _planes(frame, asked)
    details = _details(frame)
    details_at = PREFIX.size + PLANE.size * len(planes)
    place = at = _aligned(details_at + len(details))
    table: list[bytes] = []
    pieces: list[bytes | memoryview] = []
    for name, plane in planes.items():
        kind, channels = CHANNELS[name]
        table.append(PLANE.pack(name.encode(), kind, channels, place))
        pieces += [plane.data.cast("B"), bytes(_aligned(plane.nbytes) - plane.nbytes)]
        place += _aligned(plane.nbytes)
    prefix = _prefix(frame, frame.provenance, len(planes), details_at, len(details))
    return [prefix, *table, details, b" " * (at - details_at - len(details)), *pieces]


def _planes(frame: TactileFrame, asked: Collection[MapOnRequest]) -> dict[str, NDArray[Any]]:
    given: dict[str, NDArray[Any]] = {
        "image": frame.camera_frame.image,
        "gradient": frame.gradient_map,
        "depth_mm": frame.depth_mm,
        "contact": frame.contact.mask.view(np.uint8),
    }
    if frame.exposures:
        given |= {"lights": frame.exposures.lights, "moving": frame.exposures.moving.view(np.uint8)}
    given |= frame.maps_on_request(asked)
    return {name: np.ascontiguousarray(plane, TYPES[CHANNELS[name][0]]) for name, plane in given.items()}


def _prefix(frame: TactileFrame, provenance: Provenance, planes: int, details_at: int, details_length: int) -> bytes:
    contact, (height, width) = frame.contact, frame.depth_mm.shape
    return PREFIX.pack(
        MAGIC, VERSION, planes, details_at, details_length, frame.camera_frame.sequence, frame.camera_frame.time_s,
        provenance.unix_s, width, height, *provenance.pixel_size_mm, contact.indentation_mm, contact.area_mm2,
        *(contact.centroid_mm or (nan, nan)),
    )  # fmt: skip


def _details(frame: TactileFrame) -> bytes:
    camera_frame, provenance = frame.camera_frame, frame.provenance
    assert provenance is not None
    published = {**provenance.ages_s, "published": time.time() - provenance.unix_s}
    return _DETAILS.dump_json(
        Details.model_construct(
            source=camera_frame.source,
            light=None if camera_frame.light is None else tuple(map(tuple, camera_frame.light.tolist())),
            label=camera_frame.label,
            stage_seconds=frame.stage_seconds,
            exposures=frame.exposures,
            force=frame.force,
            dots=DotFigures.of(camera_frame.dots) if camera_frame.dots else None,
            shear=ShearFigures.of(frame.shear) if frame.shear else None,
            slip=frame.slip,
            contacts=frame.contacts,
            pose=frame.pose.figures() if frame.pose else None,
            from_network=frame.measures.from_network if frame.measures else None,
            provenance=replace(provenance, ages_s=published),
        )
    )


def _aligned(size: int) -> int:
    return -(-size // ALIGNMENT) * ALIGNMENT


# ---- decoding ----


def decode(message: bytes, bundle_of: Callable[[str], Bundle]) -> ReceivedFrame:
    """Return the frame of a message, whose arrays lie in it; StreamError unless it is whole and of this version.

    `bundle_of`: see `ReceivedFrame`. Whatever the message holds, no more memory is taken than it has itself.
    """
    check_version(message)
    (_, _, planes, details_at, details_length, sequence, time_s, unix_s, width, height, pixel_x, pixel_y,
     indentation_mm, area_mm2, x_mm, y_mm) = PREFIX.unpack_from(message)  # fmt: skip
    if not (0 < width <= MOST_SIDE_PX and 0 < height <= MOST_SIDE_PX and planes <= MOST_PLANES):
        raise _damaged(f"{planes} planes of {width} x {height} px")
    maps = _read_planes(message, planes, (height, width))
    details = _read_details(message, details_at, details_length)
    light = None if details.light is None else np.array(details.light, np.uint8).reshape(-1, 3)
    provenance = details.provenance
    ages_s = {**provenance.ages_s, "received": time.time() - unix_s}
    dots, pose, shear = _felt(details)
    camera_frame = CameraFrame(
        image=maps["image"], time_s=time_s, sequence=sequence, source=details.source, light=light, label=details.label,
        dots=dots,
    )  # fmt: skip
    contact = Contact(
        mask=maps["contact"].view(np.bool_),
        area_mm2=area_mm2,
        indentation_mm=indentation_mm,
        centroid_mm=None if isnan(x_mm) or isnan(y_mm) else (x_mm, y_mm),
    )
    fields = {
        "camera_frame": camera_frame,
        "gradient_map": maps["gradient"],
        "depth_mm": maps["depth_mm"],
        "contact": contact,
        "contacts": details.contacts,
        "slip": details.slip,
        "pose": pose,
        "exposures": _report(details.exposures, maps),
        "stage_seconds": details.stage_seconds,
        "_from_network": details.from_network,
        "provenance": replace(provenance, unix_s=unix_s, pixel_size_mm=(pixel_x, pixel_y), ages_s=ages_s),
    }
    frame = ReceivedFrame(bundle_of, fields)
    vars(frame)["force"] = _force(details.force, frame, maps)
    vars(frame)["shear"] = _with_traction(shear, frame)
    if "confidence" in maps and "quality_flags" in maps:
        vars(frame)["confidence"] = Confidence(value=maps["confidence"], quality_flags=maps["quality_flags"])
    return frame


def _force(figures: ForceFigures | None, frame: ReceivedFrame, maps: Mapping[str, NDArray[Any]]) -> Force | None:
    """Return the force that travelled, with the pressure map that did, or one that is computed when asked for."""
    if figures is None:
        return None

    def pressure_mpa() -> NDArray[np.float32]:
        if "pressure_mpa" in maps:
            return maps["pressure_mpa"]
        force = frame.measures.force(frame.depth_mm) if frame.measures else None
        if force is None:
            raise StreamError("the daemon's bundle has no force.json any more: read a newer frame")
        return force.pressure_mpa

    return Force(**vars(figures), pressure_of=pressure_mpa)


def _felt(details: Details) -> tuple[DotsSeen | None, ObjectPose | None, Shear | None]:
    """Return dots, pose and shear, of which the figures travelled."""
    try:
        dots = details.dots.dots() if details.dots else None
        pose = ObjectPose.of(details.pose) if details.pose else None
        return dots, pose, details.shear.shear(dots) if details.shear and dots else None
    except ValueError as error:
        raise _damaged(str(error)) from None


def _with_traction(shear: Shear | None, frame: ReceivedFrame) -> Shear | None:
    """Return the shear with a traction map that is computed when it is asked for."""
    if shear is None:
        return None

    def traction_mpa() -> NDArray[np.float32] | None:
        felt = frame.measures.shear(frame.depth_mm, shear.dots, frame.force) if frame.measures else None
        return felt.traction_mpa if felt else None

    return replace(shear, traction_of=traction_mpa)


def check_version(message: bytes) -> None:
    """Raise StreamError unless a message begins as one of this version does."""
    if len(message) < PREFIX.size or message[:4] != MAGIC:
        raise StreamError(
            f"what arrived is no frame of GelLight ({len(message)} bytes): another program publishes here"
        )
    version = int.from_bytes(message[4:6], "little")
    if version != VERSION:
        raise StreamError(f"frames have version {version} of the wire format, this program reads {VERSION}: {REMEDY}")


def _read_planes(message: bytes, count: int, shape: tuple[int, int]) -> dict[str, NDArray[Any]]:
    if len(message) < PREFIX.size + count * PLANE.size:
        raise _damaged("the list of planes is cut off")
    found: dict[str, NDArray[Any]] = {}
    for number in range(count):
        raw, kind, channels, place = PLANE.unpack_from(message, PREFIX.size + number * PLANE.size)
        name = raw.rstrip(b"\0").decode("ascii", "replace")
        name = NOW_CALLED.get(name, name)
        if name in CHANNELS:
            found[name] = _plane(message, name, (kind, channels), place, shape)
    if missing := [name for name in NEEDED if name not in found]:
        raise _damaged(f"the plane {missing[0]} is missing")
    return found


def _plane(message: bytes, name: str, said: tuple[int, int], place: int, shape: tuple[int, int]) -> NDArray[Any]:
    kind, channels = CHANNELS[name]
    size = shape[0] * shape[1] * channels * TYPES[kind].itemsize
    if said != (kind, channels) or place % ALIGNMENT or place + size > len(message):
        raise _damaged(f"the plane {name} has type and channels {said} at byte {place} of {len(message)}")
    flat = np.frombuffer(message, TYPES[kind], shape[0] * shape[1] * channels, place)
    return flat.reshape((*shape, channels) if channels > 1 else shape)


def _read_details(message: bytes, place: int, length: int) -> Details:
    if length > MOST_DETAILS or place + length > len(message):
        raise _damaged(f"{length} bytes of details at byte {place} of {len(message)}")
    with explained(_damaged, "details"):
        return _DETAILS.validate_json(message[place : place + length])


def _report(figures: ExposureFigures | None, maps: Mapping[str, NDArray[Any]]) -> ExposureReport | None:
    if figures is None:
        return None
    if missing := [name for name in ("lights", "moving") if name not in maps]:
        raise _damaged(f"the plane {missing[0]} is missing")
    return ExposureReport(**vars(figures), lights=maps["lights"], moving=maps["moving"].view(np.bool_))


def _damaged(what: str) -> StreamError:
    return StreamError(f"a frame that arrived is damaged ({what}): {REMEDY}")
