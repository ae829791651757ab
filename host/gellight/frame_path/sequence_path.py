"""GelNet for frames of the light that it was trained for, the picture alone for those of a sequence's other lights."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gellight.frame_path.picture_path import PicturePath
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.status import PathStatus


class SequencePath:
    """Reconstructs the frames that were taken wholly under the light of the calibration; others have no depth."""

    def __init__(self, network: Reconstructor, groups: NDArray[np.uint8] | None = None) -> None:
        """Use `network` for frames that have no label, and for those labelled clean under the light of its bundle.

        groups: (G, 12, 3) of the sequence that runs; None: none does, and labels are of one that was recorded.
        """
        self.bundle = network.bundle
        self._network, self._groups = network, groups

    @cached_property
    def _picture(self) -> PicturePath:
        return PicturePath(self.bundle)

    def _trained(self, colours: NDArray[np.uint8] | None) -> bool:
        light = self.bundle.colours
        return light is not None and colours is not None and np.array_equal(colours, light)

    def status(self) -> PathStatus:
        """Return the mode, ready for JSON."""
        if self._groups is None:
            return self._network.status()
        trained = [number for number, group in enumerate(self._groups) if self._trained(group)]
        return {**self._network.status(), "mode": "sequence", "groups_with_depth": trained}

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Return the tactile frame; InputError for an image of another size or type than the calibration's."""
        path = self._network if self._is_trained(camera_frame) else self._picture
        return path.reconstruct(camera_frame)

    def _is_trained(self, frame: CameraFrame) -> bool:
        if frame.label is None:
            return self._groups is None
        return frame.label.group is not None and self._trained(frame.light)
