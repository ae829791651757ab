"""A camera through OpenCV, for computers without V4L2: `opencv://0`.

OpenCV tells neither when a frame was taken nor whether one was lost, and not why a camera stops. Where V4L2 is, it is
used instead.
"""

import sys
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from gellight.base.errors import CameraError, InputError
from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame


class OpenCvCamera(Camera):
    """A camera by its index; its frames are dated when they arrive."""

    def __init__(self, index: int, *, url: str, capture: Callable[[int], Any] = cv2.VideoCapture) -> None:
        """Open the camera with this index; `capture` makes what reads it. Raises CameraError."""
        self.url = url
        self._capture = capture(index)
        self._sequence = 0
        image = self._grab()
        self.image_shape = (image.shape[0], image.shape[1])

    def read(self) -> CameraFrame:
        """Wait for the next frame; `time_s` is its arrival, the best that is known."""
        image = self._grab()
        time_s = time.monotonic()
        self._sequence += 1
        return CameraFrame(image=image, time_s=time_s, sequence=self._sequence - 1, source=self.url)

    def _grab(self) -> "np.ndarray[Any, np.dtype[np.uint8]]":
        taken, picture = self._capture.read()
        if not taken or picture is None:
            self.close()
            raise CameraError(f"{self.url} gives no frame: plug the camera in, allow its use, or end who uses it")
        return np.ascontiguousarray(picture[..., ::-1])

    def close(self) -> None:
        """Release the camera."""
        self._capture.release()


def open_opencv(url: str) -> OpenCvCamera:
    """Open `opencv://INDEX`; InputError on Linux, where V4L2 is better, and for what is no number."""
    index = url.partition("://")[2]
    if sys.platform == "linux":
        raise InputError(
            f"{url}: on Linux, use auto or v4l2:///dev/video{index or 0}, which knows when a frame was taken"
        )
    if not index.isdecimal():
        raise InputError(f"{url} names no camera: give opencv://0 for the first")
    return OpenCvCamera(int(index), url=url)
