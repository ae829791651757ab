"""A camera that a daemon reads, for a second reader: a calibration, for example."""

import time

from gellight.base.errors import CameraError
from gellight.base.mailbox import Mailbox
from gellight.frames.camera import Camera
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame

TIMEOUT_S = 20.0
"""as long as a scene of the simulated sensor may take, and longer than any camera"""


class SharedCamera(CameraWrapper):
    """Gives frames whose exposure began after they were asked for, so under the light that was set before.

    Any thread but the daemon's may read it. The frames in between are not seen by this reader.
    """

    def __init__(self, camera: Camera, captured: Mailbox[CameraFrame]) -> None:
        """Wrap the camera of a daemon, which puts its frames into `captured`."""
        super().__init__(camera)
        self._captured = captured
        self._number = 0

    def read(self) -> CameraFrame:
        """Wait for a frame whose exposure began after this call; raises what ended the camera."""
        asked_s = time.monotonic()
        while (left_s := asked_s + TIMEOUT_S - time.monotonic()) > 0:
            try:
                self._number, frame = self._captured.take(self._number, left_s)
            except TimeoutError:
                break
            if frame.time_s >= asked_s:
                return frame
        raise CameraError(f"no frame of {self.url} for {TIMEOUT_S:g} s: check the camera and start again")

    def close(self) -> None:
        """Do nothing: the daemon closes its camera."""
