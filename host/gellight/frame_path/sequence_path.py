"""The picture alone, for light or sensors that no network was trained for, and the path of a sequence of lights.

That is GelNet for frames of the light that it was trained for, and the picture alone for those of the others.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor, check_image
from gellight.frames.frames import CameraFrame, Contact, TactileFrame
from gellight.frames.status import PathStatus
from gellight.reconstruction.stages import Stages


class PicturePath:
    """Passes pictures on and feels nothing; what was not measured is NaN: depth, slopes, normals, area and indentation.

    The contact patch is empty. All frames share these maps, read-only.
    """

    def __init__(self, bundle: Bundle) -> None:
        """Pass on pictures of the size of `bundle`."""
        self.bundle = bundle
        shape = bundle.image_shape
        self._no_slopes = np.full((*shape, 2), np.nan, np.float32)
        self._no_depth, self._nowhere = np.full(shape, np.nan, np.float32), np.zeros(shape, np.bool_)
        for array in (self._no_slopes, self._no_depth, self._nowhere):
            array.flags.writeable = False

    def status(self) -> PathStatus:
        """Return the mode, and that nothing is computed, ready for JSON."""
        return {"mode": "network", "computed_by": "nothing: the sensor is not calibrated"}

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Return the tactile frame; InputError for an image of another size or type than the bundle's."""
        check_image(camera_frame, self.bundle)
        stages = Stages()
        difference = np.subtract(camera_frame.image, self.bundle.reference, dtype=np.float32)
        stages.end("difference")
        nowhere = Contact(mask=self._nowhere, area_mm2=np.nan, indentation_mm=np.nan, centroid_mm=None)
        return TactileFrame(
            camera_frame=camera_frame, difference=difference, gradient_map=self._no_slopes,
            depth_mm=self._no_depth, contact=nowhere, stage_seconds=stages.seconds,
        )  # fmt: skip


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
