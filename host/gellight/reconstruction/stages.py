"""What every way through the frame path shares: the names and times of its stages, and the frame at its end."""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import CameraFrame, Contact, ExposureReport, TactileFrame
from gellight.frames.measures import FrameMeasures
from gellight.reconstruction.contact import find_contact, patched, without_untouched
from gellight.reconstruction.perspective import Perspective

STAGES = ("difference", "mask", "gradient", "depth", "normals", "contact")
"""Keys of `TactileFrame.stage_seconds`, in the order of the path; `lens` follows `gradient` where there is one."""

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class NetworkRows:
    """How often the network was asked for one frame; 0 where nobody counts."""

    coarse: int = 0
    """means of 8 x 8 pixels where nothing touches, if the Jacobian at no difference does not do"""
    cells: int = 0
    """means of 4 x 4 and 8 x 8 pixels near a touch, with the Jacobian"""
    pixels: int = 0


class TactilePath(Protocol):
    """One way of computing: a camera frame of the bundle's size and type in, a tactile frame out."""

    network_rows: NetworkRows
    """of the latest frame"""

    def reconstruct(self, camera_frame: CameraFrame, /) -> TactileFrame:
        """Return the maps and the contact."""


class Stages:
    """The wall time of each stage of one frame."""

    def __init__(self) -> None:
        """Begin the first stage."""
        self.seconds: dict[str, float] = {}
        self._began = time.perf_counter()

    def end(self, stage: str) -> None:
        """Record the time since the stage before ended."""
        now = time.perf_counter()
        self.seconds[stage] = now - self._began
        self._began = now

    def skip(self, stages: Iterable[str]) -> None:
        """Record that these stages had nothing to do."""
        self.seconds.update(dict.fromkeys(stages, 0.0))


class FlatMaps:
    """The maps of untouched gel. They are always the same, so all frames at rest share them, read-only."""

    def __init__(self, image_shape: tuple[int, int], *, stages: tuple[str, ...]) -> None:
        """Make them for images of one size (H, W); stages: of a frame that is touched."""
        self._stages = stages
        self._gradient_map = np.zeros((*image_shape, 2), np.float32)
        self._depth_mm = np.zeros(image_shape, np.float32)
        self._nowhere = np.zeros(image_shape, np.bool_)
        for array in (self._gradient_map, self._depth_mm, self._nowhere):
            array.flags.writeable = False

    def frame(self, camera_frame: CameraFrame, difference: Floats, stages: Stages) -> TactileFrame:
        """Return the tactile frame of untouched gel."""
        stages.skip(stage for stage in self._stages if stage not in stages.seconds)
        return TactileFrame(
            camera_frame=camera_frame,
            difference=difference,
            gradient_map=self._gradient_map,
            depth_mm=self._depth_mm,
            contact=Contact(mask=self._nowhere, area_mm2=0.0, indentation_mm=0.0, centroid_mm=None),
            stage_seconds=stages.seconds,
        )


def tactile_frame(
    camera_frame: CameraFrame,
    difference: Floats,
    gradient_map: Floats,
    depth_mm: Floats,
    pixel_size_mm: tuple[float, float],
    stages: Stages,
    exposures: ExposureReport | None = None,
    measures: FrameMeasures | None = None,
    touched: NDArray[np.bool_] | None = None,
    perspective: Perspective | None = None,
) -> TactileFrame:
    """Do the last two stages, normals and contact, and put the frame together.

    touched: (H, W) where the picture says so; None: contact may be anywhere. perspective: None along parallel rays.
    """
    stages.end("normals")
    contact = find_contact(depth_mm, pixel_size_mm)
    if touched is not None:
        contact = without_untouched(contact, touched, depth_mm, pixel_size_mm)
    contact, contacts = patched(contact, depth_mm, gradient_map, pixel_size_mm, perspective)
    stages.end("contact")
    return TactileFrame(
        camera_frame=camera_frame,
        difference=difference,
        gradient_map=gradient_map,
        depth_mm=depth_mm,
        contact=contact,
        contacts=tuple(contacts),
        exposures=exposures,
        stage_seconds=stages.seconds,
        measures=measures,
    )
