"""A video of pictures, MPEG-4."""

from pathlib import Path
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError

SLOWEST = 0.01
"""pictures a second"""


class VideoFile:
    """Takes pictures of one size; a context manager that finishes the file."""

    def __init__(self, path: Path, fps: float) -> None:
        """Begin with the first picture; InputError for a rate that MPEG-4 cannot have."""
        if fps < SLOWEST:
            raise InputError(f"{fps:.3g} pictures a second make no video: leave out fewer frames")
        self._path, self._fps = path, fps
        self._writer: cv2.VideoWriter | None = None
        self._count = 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Add an (H, W, 3) RGB picture; OSError where the file cannot be written."""
        if self._writer is None:
            size = picture.shape[1], picture.shape[0]
            self._writer = cv2.VideoWriter(str(self._path), cv2.VideoWriter.fourcc(*"mp4v"), self._fps, size)
            if not self._writer.isOpened():
                raise OSError(f"no video can be begun in {self._path.name}")
        self._writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        self._count += 1

    def __enter__(self) -> Self:
        """Give the file itself."""
        return self

    def __exit__(self, *problem: object) -> None:
        """Finish the file; OSError where it has not become whole, of which the encoder says nothing."""
        if self._writer is None:
            return
        self._writer.release()
        written = int(cv2.VideoCapture(str(self._path)).get(cv2.CAP_PROP_FRAME_COUNT))
        if written != self._count and problem[:1] in ((), (None,)):
            raise OSError(f"{self._path.name} has {written} of {self._count} pictures")
