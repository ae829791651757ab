"""A camera that is read by a daemon already, as a second reader sees it: a calibration, for example.

Who reads a camera alone knows that a frame is exposed after he asked for it, under the light that he has set before.
So it is here: a frame whose exposure began earlier is passed over.
"""

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError
from gellight.base.mailbox import Mailbox
from gellight.frames.camera import Camera, CameraControls
from gellight.frames.frames import CameraFrame
from gellight.frames.judging import FrameJudge
from gellight.frames.timing import CameraTiming
from gellight.ring.light_ring import LightRing

TIMEOUT_S = 20.0
"""as long as a scene of the simulated sensor may take, and longer than any camera"""


class SharedCamera(Camera):
    """Gives frames of the daemon that were exposed after they were asked for; the others, this reader misses."""

    def __init__(self, camera: Camera, captured: Mailbox[CameraFrame]) -> None:
        """Read along `camera`, whose frames arrive in `captured`."""
        self.url, self.image_shape, self.stage = camera.url, camera.image_shape, camera.stage
        self._camera, self._captured = camera, captured
        self._number = 0

    @property
    def ring(self) -> LightRing | None:  # type: ignore[override]  # another one after the sensor was unplugged
        """The ring of the camera."""
        return self._camera.ring

    @property
    def controls(self) -> CameraControls | None:  # type: ignore[override]  # as the ring
        """The controls of the camera."""
        return self._camera.controls

    @property
    def timing(self) -> CameraTiming | None:
        """When the camera exposes its rows."""
        return self._camera.timing

    def selfcheck(self, pixel_size_mm: tuple[float, float]) -> FrameJudge | None:
        """Return the judge of the camera."""
        return self._camera.selfcheck(pixel_size_mm)

    def status(self) -> dict[str, object]:
        """Return what is known of the camera inside."""
        return self._camera.status()

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set and light the camera inside."""
        self._camera.adopt(controls, colours)

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
