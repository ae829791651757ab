"""What every way through the frame path shares: the names and times of its stages, and the frame at its end."""

import time
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import CameraFrame, ExposureReport, TactileFrame
from gellight.reconstruction.contact import find_contact
from gellight.reconstruction.integration import normals

STAGES = ("difference", "mask", "gradient", "depth", "normals", "contact")
"""Keys of `TactileFrame.stage_seconds`, in the order of the path; `lens` follows `gradient` where there is one."""

Floats = NDArray[np.float32]


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


def tactile_frame(
    camera_frame: CameraFrame,
    difference: Floats,
    gradient_map: Floats,
    depth_mm: Floats,
    pixel_size_mm: tuple[float, float],
    stages: Stages,
    exposures: ExposureReport | None = None,
) -> TactileFrame:
    """Do the last two stages, normals and contact, and put the frame together."""
    normal_map = normals(gradient_map)
    stages.end("normals")
    contact = find_contact(depth_mm, pixel_size_mm)
    stages.end("contact")
    return TactileFrame(
        camera_frame=camera_frame,
        difference=difference,
        gradient_map=gradient_map,
        normal_map=normal_map,
        depth_mm=depth_mm,
        contact=contact,
        exposures=exposures,
        stage_seconds=stages.seconds,
    )
