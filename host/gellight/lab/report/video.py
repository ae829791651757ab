"""A video of pictures, MPEG-4."""

from pathlib import Path
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError


class VideoFile:
    """Takes pictures of one size; a context manager that finishes the file."""

    def __init__(self, path: Path, fps: float) -> None:
        """Begin with the first picture."""
        self._path, self._fps = path, fps
        self._writer: cv2.VideoWriter | None = None

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Add an (H, W, 3) RGB picture; InputError where the file cannot be written."""
        if self._writer is None:
            size = picture.shape[1], picture.shape[0]
            self._writer = cv2.VideoWriter(str(self._path), cv2.VideoWriter.fourcc(*"mp4v"), self._fps, size)
            if not self._writer.isOpened():
                raise InputError(f"{self._path} cannot be written: choose a folder that can be, and the ending .mp4")
        self._writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))

    def __enter__(self) -> Self:
        """Give the file itself."""
        return self

    def __exit__(self, *problem: object) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._writer.release()
