"""The frame path of a sensor whose light follows a sequence: GelNet where it was trained, else the picture alone."""

import numpy as np
from numpy.typing import NDArray

from gellight.frame_path.picture_path import PicturePath
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, LightState, TactileFrame
from gellight.frames.status import PathStatus


class SequencePath:
    """Reconstructs the frames that were taken wholly under the light of the calibration; others have no depth."""

    def __init__(self, network: Reconstructor, groups: NDArray[np.uint8]) -> None:
        """Use `network` for frames labelled with the group, of `groups` (G, 12, 3), that its bundle was made under."""
        self.bundle = network.bundle
        self._network = network
        light = self.bundle.colours
        self._trained = {k for k, group in enumerate(groups) if light is not None and np.array_equal(group, light)}
        self._picture = PicturePath(self.bundle)

    def status(self) -> PathStatus:
        """Return the mode, ready for JSON."""
        return {**self._network.status(), "mode": "sequence", "groups_with_depth": sorted(self._trained)}

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Return the tactile frame; InputError for an image of another size or type than the calibration's."""
        label = camera_frame.label
        if label is not None and label.state is LightState.CLEAN and label.group in self._trained:
            return self._network.reconstruct(camera_frame)
        return self._picture.reconstruct(camera_frame)
