"""The frame path of a sensor whose light follows a sequence: GelNet where it was trained, else the picture alone."""

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import CameraFrame, Contact, LightState, TactileFrame
from gellight.reconstruction.pipeline import Reconstructor
from gellight.reconstruction.stages import Stages


class SequencePath:
    """Reconstructs the frames that were taken wholly under the light of the calibration; others have no depth.

    What was not measured is NaN: depth, slopes, normals, area and indentation. The contact patch is empty.
    """

    def __init__(self, network: Reconstructor, groups: NDArray[np.uint8]) -> None:
        """Use `network` for frames labelled with the group, of `groups` (G, 12, 3), that its bundle was made under."""
        self.bundle = network.bundle
        self._network = network
        light = self.bundle.colours
        self._trained = {k for k, group in enumerate(groups) if light is not None and np.array_equal(group, light)}
        shape = self.bundle.image_shape
        self._nothing = [np.full((*shape, n), np.nan, np.float32) for n in (2, 3)]
        self._no_depth, self._nowhere = np.full(shape, np.nan, np.float32), np.zeros(shape, np.bool_)
        for array in (*self._nothing, self._no_depth, self._nowhere):
            array.flags.writeable = False

    def status(self) -> dict[str, object]:
        """Return the mode, ready for JSON."""
        return {**self._network.status(), "mode": "sequence", "groups_with_depth": sorted(self._trained)}

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Return the tactile frame; InputError for an image of another size or type than the calibration's."""
        label = camera_frame.label
        if label is not None and label.state is LightState.CLEAN and label.group in self._trained:
            return self._network.reconstruct(camera_frame)
        self._network.check(camera_frame)
        stages = Stages()
        difference = np.subtract(camera_frame.image, self.bundle.reference, dtype=np.float32)
        stages.end("difference")
        slopes, normals = self._nothing
        nowhere = Contact(mask=self._nowhere, area_mm2=np.nan, indentation_mm=np.nan, centroid_mm=None)
        return TactileFrame(
            camera_frame=camera_frame, difference=difference, gradient_map=slopes, normal_map=normals,
            depth_mm=self._no_depth, contact=nowhere, stage_seconds=stages.seconds,
        )  # fmt: skip
