"""Image files and videos as a camera: each picture once, in the given order.

A video counts as a folder of pictures: `press.mp4/press-000017.png` is its 18th. What reads a picture by its path so
reads pictures of videos too.
"""

import glob
import re
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, InputError, first_line, printable
from gellight.base.png import cut_off
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.frames import CameraFrame
from gellight.frames.jpeg import CorruptPictureError, decode_jpeg_file
from gellight.frames.video_files import (
    VIDEO_SUFFIXES,
    frame_of_video,
    frames_of_video,
    is_frame_of_video,
    times_of_video,
)

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
KINDS = (
    "give an image or video file, a folder of images, a quoted pattern such as 'presses/*.png', sim://, auto, "
    "sensor://NAME or v4l2:///dev/video0"
)

_LFS = b"version https://git-lfs."


class ImageCamera(Camera):
    """Deliver image files, each once and in the given order, as the frames of a camera.

    `live`: a picture is of the moment in which it is read, as of a camera that runs; those of a video have the video's
    own times, the last one that of the opening. Otherwise time does not go on, so that each picture stands for itself.
    """

    waits = True

    def __init__(self, paths: Sequence[Path], *, url: str | None = None, live: bool = False) -> None:
        """Open the files; the first one is read to learn the size, the others when their turn comes."""
        if not paths:
            raise CameraError(f"no images: {KINDS}")
        self._paths = tuple(paths)
        self.url = printable(paths[0] if url is None else url)
        height, width, _ = read_image(self._paths[0]).shape
        self.image_shape = (height, width)
        self._times_s = _times_of(self._paths) if live else [0.0] * len(self._paths)
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
        time_s = self._times_s[sequence] if self._times_s else time.monotonic()
        return CameraFrame(image=image, time_s=time_s, sequence=sequence, source=printable(path))

    def close(self) -> None:
        """End the delivery."""
        self._closed = True


def _times_of(paths: Sequence[Path]) -> list[float]:
    """Return when the pictures of a whole video were taken, none of them in the future; nothing for other pictures."""
    if not is_frame_of_video(paths[0]):
        return []
    times_s = times_of_video(paths[0].parent)
    begun_s = time.monotonic() - times_s[-1]
    return [begun_s + time_s for time_s in times_s] if len(times_s) == len(paths) else []


def read_image(path: Path) -> NDArray[np.uint8]:
    """Read a picture as (H, W, 3) uint8 RGB: an image file or a picture of a video.

    16 bit become 8 (divided by 257 and rounded), one channel becomes three equal ones, alpha is left out. Raises
    InputError for what is no picture.
    """
    levels = read_levels(path)
    if levels.dtype == np.uint16:
        levels = np.rint(levels / 257).astype(np.uint8)
    return np.ascontiguousarray(levels if levels.ndim == 3 else np.repeat(levels[..., None], 3, axis=2))


def read_levels(path: Path) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Read a picture with all of its bits: (H, W) or (H, W, 3) RGB, uint8 or uint16, without alpha; else InputError."""
    if is_frame_of_video(path):
        return frame_of_video(path)
    if not path.is_file():
        what = "is no file" if path.exists() else "does not exist"
        raise InputError(f"image {path} {what}: check the name")
    if path.suffix.lower() not in IMAGE_SUFFIXES:
        raise InputError(f"{path} is not an image by its name: convert it to one of {' '.join(IMAGE_SUFFIXES)}")
    try:
        content = path.read_bytes()
        if content.startswith(_LFS):
            raise InputError(
                f"{path} is the pointer of a file that lies in Git LFS: run `git lfs pull` where it is from"
            )
        if (decoded := decode_jpeg_file(content)) is not None:
            return decoded
        readable, flags = content and not cut_off(content), cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
        image = cv2.imdecode(np.frombuffer(content, np.uint8), flags) if readable else None
    except (OSError, cv2.error, CorruptPictureError) as error:
        raise InputError(f"{path} cannot be read ({first_line(error)}): capture or copy it again") from error
    if image is None:
        raise InputError(f"{path} is not an image or is cut off: capture or copy it again")
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path} has values of type {image.dtype}: save it with 8 or 16 bit per channel")
    found = image if image.ndim == 2 else image[..., 2::-1]  # BGR, or BGR and alpha
    kept: NDArray[np.uint8] | NDArray[np.uint16] = np.ascontiguousarray(found)  # type: ignore[assignment]
    return kept


def read_grey(path: Path, white: float | None = None) -> NDArray[np.float32]:
    """Read a picture as (H, W) grey levels from 0 to 255 with their fraction, colours averaged.

    white: level that becomes 255; None: 255 of 8 bit and 65535 of 16 bit. Raises InputError for what is no picture.
    """
    levels = read_levels(path)
    largest = float(np.iinfo(levels.dtype).max) if white is None else white
    grey = levels if levels.ndim == 2 else levels.mean(axis=2)
    return np.asarray(grey * (255 / largest), np.float32)


def image_files(text: str) -> list[Path]:
    """List the pictures that a folder, a pattern, a video or a file name stands for, in natural order."""
    path = Path(text)
    if is_file(text) and path.is_dir():
        found = [p for p in path.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES and not p.name.startswith(".")]
        if not found:
            raise CameraError(f"folder {path} has no images ({' '.join(IMAGE_SUFFIXES)}): {KINDS}")
    elif path.suffix.lower() in VIDEO_SUFFIXES and path.is_file():
        return frames_of_video(path)
    elif is_file(text) or is_frame_of_video(path):
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
