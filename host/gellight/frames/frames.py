"""What travels through the host: a camera frame goes in, a tactile frame comes out.

Axes: x right (columns), y down (rows), z from the gel to the camera. Arrays are indexed ``[row, column]``.
Depth is indentation in mm, positive into the sensor, 0 where the gel is at rest. Positions in mm are measured
from the centre of the image.

What holds arrays is equal to itself alone: comparing arrays gives no single answer.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.measures import Confidence, ErrorBounds, Force, FrameMeasures, MapOnRequest
from gellight.frames.point_cloud import normals, points_of
from gellight.frames.pose import ObjectPose
from gellight.frames.shear import DotsSeen, Shear, ShearTruth, Slip
from gellight.frames.status import ExposuresStatus


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundTruth:
    """The gel surface that a simulated camera looked at: what only a simulator can know."""

    depth_mm: NDArray[np.float32]
    """(H, W) mm"""
    gradient_map: NDArray[np.float32]
    """(H, W, 2) d(depth)/dx, d(depth)/dy, dimensionless"""
    contact: NDArray[np.bool_]
    """(H, W) where the object touches the gel (contact pressure above zero)"""
    object_name: str = ""
    """what is pressed; empty: nothing, or it is not known"""
    press_depth_mm: float = 0.0
    place_mm: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the object's middle from the image centre"""
    pose: NDArray[np.float64] | None = None
    """(4, 4) carries points of the object, mm, to x right, y down, z towards the camera; None: nothing is pressed"""
    shear: ShearTruth | None = None
    """how the gel is moved along itself; None where it has no dots"""

    def __repr__(self) -> str:
        """Return size and largest depth in one line."""
        return f"<GroundTruth {_size(self.depth_mm)}, {float(self.depth_mm.max()):.3f} mm deep>"


def _size(image: NDArray[Any]) -> str:
    """Return columns and rows of an image or a map."""
    return f"{image.shape[1]}x{image.shape[0]}"


class LightState(StrEnum):
    """What is known of the light of one exposure."""

    CLEAN = "clean"
    """every row was exposed under one and the same light"""
    MIXED = "mixed"
    """the light changed while some row was exposed"""
    UNKNOWN = "unknown"
    """it cannot be told"""


@dataclass(frozen=True, kw_only=True)
class LightLabel:
    """Under which light group of a running sequence a frame was taken."""

    state: LightState
    group: int | None = None
    """index of the group; None unless the frame is clean"""


@dataclass(frozen=True, kw_only=True)
class EncodedImage:
    """A picture as the camera gave it, before it was decoded."""

    data: bytes
    letters: str
    """format, as V4L2 names it: MJPG, YUYV, RGB3 or GREY"""
    line_bytes: int
    """of a picture line in `data`; 0: there is nothing between the lines, or the picture is compressed"""


@dataclass(frozen=True, kw_only=True, eq=False)
class CaptureStamp:
    """What was in force when a daemon took a frame, however late it is asked for."""

    zeroed: Bundle
    """the bundle in use with the zero in use"""
    unix_s: float
    """start of the exposure on the clock of `time.time`, which other machines have too"""


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraFrame:
    """One picture of the gel."""

    image: NDArray[np.uint8]
    """(H, W, 3) RGB"""
    time_s: float
    """start of the exposure on the clock of `time.monotonic`"""
    sequence: int
    """counts the frames the camera took; a gap is a lost frame, a repetition is the same frame again"""
    estimated: bool = False
    """the camera did not tell when it took this frame: `time_s` is too early by some periods, never too late"""
    source: str = ""
    """where the frame came from, for messages: a file name or the URL of the camera"""
    light: NDArray[np.uint8] | None = None
    """(12, 3) RGB of each LED during the exposure; None where the camera cannot know its light"""
    label: LightLabel | None = None
    """the light group of a sequence that lit it; None where no sequence runs"""
    dots: DotsSeen | None = None
    """the marker dots before they were filled; None for a gel without dots whose places its bundle knows"""
    truth: GroundTruth | None = None
    """what was really there; None on real cameras"""
    encoded: EncodedImage | None = None
    """what `image` was decoded from, for recordings; None where it was not"""
    stamp: CaptureStamp | None = None
    """None where no daemon took it"""

    def __repr__(self) -> str:
        """Return size, number, time and light in one line."""
        light = f", {self.label.state} light" if self.label else ""
        return f"<{type(self).__name__} {_size(self.image)}, sequence {self.sequence}, {self.time_s:.3f} s{light}>"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ExposureSeries(CameraFrame):
    """The exposures of all light groups; as a camera frame it is the first of them.

    The first light is shown again at the end, by which a scene that moved is found out.
    """

    groups: NDArray[np.uint8]
    """(G, 12, 3) RGB of the LEDs in each light group"""
    frames: tuple[tuple[CameraFrame, ...], ...]
    """for each group, the frames that were taken under it"""
    opening: CameraFrame
    """the first frame"""
    closing: CameraFrame
    """the last frame, under the light of the first"""
    exposure_us: float | None = None
    """of the frames under light groups; None where the camera does not tell"""

    @property
    def pictures(self) -> list[list[NDArray[np.uint8]]]:
        """The images of each group."""
        return [[frame.image for frame in frames] for frames in self.frames]


@dataclass(frozen=True, kw_only=True, eq=False)
class Contact:
    """Where and how deep the gel is touched."""

    mask: NDArray[np.bool_]
    """(H, W) contact patch"""
    area_mm2: float
    indentation_mm: float
    """largest depth, 0 where nothing touches"""
    centroid_mm: tuple[float, float] | None
    """(x, y) of the patch from the image centre; None where nothing touches"""

    def __repr__(self) -> str:
        """Return depth, area and place in one line."""
        return f"<Contact: {self.in_words()}>"

    def in_words(self) -> str:
        """Return depth, area and place, or that nothing touches."""
        if self.centroid_mm is None:
            return "no contact"
        x_mm, y_mm = self.centroid_mm
        return f"{self.indentation_mm:.3f} mm deep, {self.area_mm2:.1f} mm2 at ({x_mm:.1f}, {y_mm:.1f}) mm"


@dataclass(frozen=True, kw_only=True)
class Patch:
    """One of the places where the gel is touched: a connected part of the contact patch."""

    centroid_mm: tuple[float, float]
    """(x, y) from the image centre"""
    depth_mm: float
    """largest depth"""
    area_mm2: float
    volume_mm3: float
    """the integral of the depth over the patch"""
    slope_rad: float
    """largest angle between the gel surface and the gel at rest"""
    number: int = 0
    """stays as long as the contact lasts, and no other one gets it; 0 where no sensor runs that follows it"""
    age_s: float = 0.0
    """since it was first seen"""
    velocity_mm_s: tuple[float, float] | None = None
    """(x, y) of the centroid, over the last 0.15 s, or since the frame before; None in its first frame"""


@dataclass(frozen=True, kw_only=True, eq=False)
class ExposureFigures:
    """What is known of the exposures under different lights that were put together to one tactile frame, as numbers."""

    exposures: int
    """light groups"""
    duration_s: float
    """from the start of the first exposure to the start of the last"""
    moved: bool
    """the scene changed meanwhile: the maps are of no one scene"""
    repetition_grey: float
    """largest change of 8 x 8 pixels between the first exposure and its repetition at the end"""
    repetition_limit_grey: float
    """what noise can do of it"""
    misfit: float
    """how badly the exposures fit one surface at worst; above 1 they do not"""
    least_lights: int
    """with fewer than this the slope of a pixel is a guess"""


@dataclass(frozen=True, kw_only=True, eq=False)
class ExposureReport(ExposureFigures):
    """All that is known of these exposures."""

    lights: NDArray[np.uint8] = field(repr=False)
    """(H, W) LEDs that were neither shadowed nor clipped, and so were used"""
    moving: NDArray[np.bool_] = field(repr=False)
    """(H, W) where the picture under one light changed meanwhile, by means over 8 x 8 pixels"""

    def as_json(self) -> ExposuresStatus:
        """Return the figures without the maps."""
        return {
            "exposures": self.exposures,
            "duration_s": round(self.duration_s, 3),
            "moved": self.moved,
            "repetition_grey": round(self.repetition_grey, 3),
            "repetition_limit_grey": round(self.repetition_limit_grey, 3),
            "misfit": round(self.misfit, 3),
            "moving": round(float(self.moving.mean()), 5),
            "guessed": round(float((self.lights < self.least_lights).mean()), 5),
        }


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """With what a tactile frame was computed, when, and what is known against it."""

    calibration: str
    """identity of the calibration bundle"""
    zero: str
    """identity of that bundle with the reference image that was subtracted; another one after each re-zero"""
    pixel_size_mm: tuple[float, float]
    """(x, y) size of a pixel of the maps on the gel"""
    unix_s: float
    """start of the exposure on the clock of `time.time`, which other machines have too"""
    ages_s: Mapping[str, float]
    """time since the start of the exposure when the frame was `taken` from the camera, `reconstructed`, `published`
    and `received`; the last two only where it came from another process"""
    findings: tuple[str, ...] = ()
    """kinds of what the watch has found, such as "drift" or "led_dead"; see docs/watch.md"""
    dropped: int = 0
    """camera frames between the last tactile frame that this reader had and this one"""
    gel_thickness_mm: float | None = None
    """None where nobody knows"""
    camera_height_mm: float = 0.0
    """above the gel, as it seems from within it; 0 where nobody knows: it is then taken to be far away"""


@dataclass(frozen=True, kw_only=True, eq=False)
class TactileFrame:
    """What the sensor feels in one camera frame."""

    camera_frame: CameraFrame
    difference: NDArray[np.float32]
    """(H, W, 3) image minus reference image, grey levels"""
    gradient_map: NDArray[np.float32]
    """(H, W, 2) d(depth)/dx, d(depth)/dy, dimensionless; with a lens in the bundle, over the undistorted gel, as are
    all maps below, while the images above are as taken"""
    depth_mm: NDArray[np.float32]
    """(H, W) mm"""
    contact: Contact
    contacts: tuple[Patch, ...] = ()
    """the connected parts of the contact, the deepest first; of a sensor that runs, followed from frame to frame"""
    slip: Slip | None = None
    """of a sensor that runs: whether what touches slips; None for a gel without dots"""
    pose: ObjectPose | None = None
    """where the object has gone since it was first touched; None where nothing touches or nobody asked for tracking"""
    exposures: ExposureReport | None = None
    """how the exposures went that it was measured from; None where it was felt in one frame"""
    stage_seconds: dict[str, float] = field(default_factory=dict)
    """wall time of each stage of the frame path"""
    provenance: Provenance | None = None
    """None where no daemon ran, as for the images of `gellight reconstruct`"""
    measures: FrameMeasures | None = field(default=None, repr=False)
    """computes the properties below when they are first asked for"""

    @cached_property
    def normal_map(self) -> NDArray[np.float32]:
        """(H, W, 3) unit normals of the gel surface, towards the camera."""
        return normals(self.gradient_map)

    @cached_property
    def points_mm(self) -> NDArray[np.float32] | None:
        """(H, W, 3) where the gel lies that each pixel shows: see `points_of`; None where no provenance tells sizes."""
        made = self.provenance
        return points_of(self.depth_mm, made.pixel_size_mm, made.camera_height_mm) if made else None

    @cached_property
    def force(self) -> Force | None:
        """The normal force, N, and the pressure map; None where the sensor's bundle has no constant for it."""
        return self.measures.force(self.depth_mm) if self.measures else None

    @cached_property
    def shear(self) -> Shear | None:
        """How the gel is moved and pulled along itself, by its marker dots; None without dots, or without depth."""
        dots = self.camera_frame.dots
        return self.measures.shear(self.depth_mm, dots, self.force) if self.measures and dots else None

    @cached_property
    def confidence(self) -> Confidence | None:
        """How far each pixel is to be believed, and why not; None for frames under another light, without depth."""
        return self.measures.confidence(self.camera_frame.image, self.gradient_map) if self.measures else None

    @cached_property
    def error_bounds(self) -> ErrorBounds | None:
        """By how much 90 % of the pixels are off at most; None where the bundle does not know its errors."""
        measures, maps = self.measures, (self.gradient_map, self.depth_mm, self.contact.mask)
        bounds = measures.error_bounds(*maps) if measures else None
        return bounds.unless(self.confidence.not_learnt) if bounds and self.confidence else bounds

    def maps_on_request(self, asked: Collection[MapOnRequest] = tuple(MapOnRequest)) -> dict[str, NDArray[Any]]:
        """Return the maps that are asked for and that this frame can have; `quality_flags` come with `confidence`."""
        maps: dict[str, NDArray[Any]] = {}
        if MapOnRequest.PRESSURE in asked and self.force:
            maps["pressure_mpa"] = self.force.pressure_mpa
        if MapOnRequest.CONFIDENCE in asked and self.confidence:
            maps |= {"confidence": self.confidence.value, "quality_flags": self.confidence.quality_flags}
        return maps

    def with_dropped(self, dropped: int) -> Self:
        """Return the same frame, whose maps are not copied, with another count of frames dropped before it."""
        if self.provenance is None or self.provenance.dropped == dropped:
            return self
        other = copy.copy(self)
        object.__setattr__(other, "provenance", replace(self.provenance, dropped=dropped))
        return other

    def __repr__(self) -> str:
        """Return size, number, time and contact in one line."""
        taken = self.camera_frame
        when = f"sequence {taken.sequence}, {taken.time_s:.3f} s"
        return f"<TactileFrame {_size(self.depth_mm)}, {when}, {self.contact.in_words()}>"
