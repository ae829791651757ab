"""A camera and a sink of your own: `gellight run --sensor grey://127 --sink forces`."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from gellight import CameraFrame, TactileFrame
from gellight.frames.camera import Camera


class GreyCamera(Camera):
    """Pictures of one grey level, thirty a second: grey://127."""

    def __init__(self, url: str) -> None:
        """Open what the URL names; what it cannot be is an InputError or CameraError of gellight.base.errors."""
        self.url, self.image_shape, self._count = url, (480, 640), 0
        self._image = np.full((480, 640, 3), int(url.partition("://")[2]), np.uint8)

    def read(self) -> CameraFrame:
        """Return the next frame; `time_s` is when its exposure began, by time.monotonic."""
        time.sleep(1 / 30)
        self._count += 1
        return CameraFrame(image=self._image, time_s=time.monotonic(), sequence=self._count, source=self.url)

    def close(self) -> None:
        """Give the device back."""


@contextmanager
def forces(name: str) -> Iterator[Callable[[TactileFrame], None]]:
    """Write a line for each frame to NAME.csv."""
    with Path(f"{name}.csv").open("w") as file:
        yield lambda frame: print(frame.camera_frame.sequence, frame.contact.indentation_mm, sep=",", file=file)
