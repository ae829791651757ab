"""A series of exposures as one frame of a camera, so that it can go where a camera frame goes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import CameraFrame


@dataclass(frozen=True, kw_only=True)
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
