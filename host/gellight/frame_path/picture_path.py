"""The frame path that feels nothing: the picture alone, for light or sensors that no network was trained for."""

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, Contact, TactileFrame
from gellight.frames.status import PathStatus
from gellight.reconstruction.stages import Stages


class PicturePath:
    """Passes pictures on; what was not measured is NaN: depth, slopes, normals, area and indentation.

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


def check_image(camera_frame: CameraFrame, bundle: Bundle) -> None:
    """Raise InputError unless an image is of the size and type of a calibration."""
    image, name = camera_frame.image, camera_frame.source or "the image"
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise InputError(f"{name} is {image.shape} {image.dtype}: give (H, W, 3) uint8, RGB")
    if image.shape[:2] != bundle.image_shape:
        height, width = bundle.image_shape
        raise InputError(
            f"{name} is {image.shape[1]} x {image.shape[0]} px, the calibration {bundle.source} is for "
            f"{width} x {height} px: set the camera to that size or use the calibration of this sensor"
        )
