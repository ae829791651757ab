"""Image files as a camera: each once, in the given order."""

import glob
import re
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, InputError
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.frames import CameraFrame

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
KINDS = (
    "give an image file, a folder of images, a quoted pattern such as 'presses/*.png', sim://, auto, sensor://NAME or "
    "v4l2:///dev/video0"
)


class ImageCamera(Camera):
    """Deliver image files, each once and in the given order, as the frames of a camera."""

    def __init__(self, paths: Sequence[Path], *, url: str | None = None) -> None:
        """Open the files; the first one is read to learn the size, the others when their turn comes."""
        if not paths:
            raise CameraError(f"no images: {KINDS}")
        self._paths = tuple(paths)
        self.url = url if url is not None else str(paths[0])
        height, width, _ = read_image(self._paths[0]).shape
        self.image_shape = (height, width)
        self._next = 0
        self._closed = False

    def read(self) -> CameraFrame:
        """Read the next image; raises EndOfStream after the last one."""
        if self._closed:
            raise CameraError(f"camera {self.url} is closed: open it again")
        if self._next >= len(self._paths):
            raise EndOfStream(f"camera {self.url} has delivered all of its {len(self._paths)} images")
        sequence, path = self._next, self._paths[self._next]
        self._next += 1
        image = read_image(path)
        if image.shape[:2] != self.image_shape:
            raise InputError(
                f"{path} is {_size(image.shape)}, {self._paths[0].name} is {_size(self.image_shape)}: "
                "put images of one size together"
            )
        return CameraFrame(image=image, time_s=time.monotonic(), sequence=sequence, source=str(path))

    def close(self) -> None:
        """End the delivery."""
        self._closed = True


def read_image(path: Path) -> NDArray[np.uint8]:
    """Read an image file of three 8-bit channels as (H, W, 3) RGB; anything else raises InputError."""
    if not path.is_file():
        raise InputError(f"image {path} does not exist: check the name")
    if path.suffix.lower() not in IMAGE_SUFFIXES:
        raise InputError(f"{path} is not an image by its name: convert it to one of {' '.join(IMAGE_SUFFIXES)}")
    try:
        content = np.fromfile(path, np.uint8)
        image = cv2.imdecode(content, cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION) if content.size else None
    except (OSError, cv2.error) as error:
        raise InputError(f"{path} cannot be read ({error}): capture or copy it again") from error
    if image is None:
        raise InputError(f"{path} is not an image or is cut off: capture or copy it again")
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise InputError(
            f"{path} has {channels} channels of {image.dtype.itemsize * 8} bit: "
            "capture it as RGB with 8 bit per channel and without alpha"
        )
    return np.ascontiguousarray(image[..., ::-1])


def image_files(text: str) -> list[Path]:
    """List the files that a folder, a pattern or a file name stands for, in natural order."""
    path = Path(text)
    if is_file(text) and path.is_dir():
        found = [p for p in path.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES and not p.name.startswith(".")]
        if not found:
            raise CameraError(f"folder {path} has no images ({' '.join(IMAGE_SUFFIXES)}): {KINDS}")
    elif is_file(text):
        found = [path]
    else:
        found = [Path(name) for name in glob.glob(text)]  # noqa: PTH207  (the pattern may be absolute)
        if not found:
            raise CameraError(f"{text!r} is no file, no folder and no pattern that matches a file: {KINDS}")
    return sorted(found, key=_natural)


def is_file(text: str) -> bool:
    """Whether it is the name of a file or a folder; one that is too long for a name is not."""
    try:
        return Path(text).exists()
    except OSError:
        return False


def _natural(path: Path) -> tuple[list[tuple[int, int | str]], str]:
    """Sort key that puts image2 before image10."""
    pieces = re.split(r"(\d+)", path.name)
    return [(0, int(piece)) if piece.isdecimal() else (1, piece.lower()) for piece in pieces], str(path)


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]} px"
