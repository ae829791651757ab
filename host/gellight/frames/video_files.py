"""The pictures of a video file, by the names of files in a folder: `press.mp4/press-000017.png` is the 18th.

Pictures are always decoded one after the other from the beginning: seeking in a compressed video may give another one.
"""

import re
import threading
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError

VIDEO_SUFFIXES = (".mp4", ".avi", ".mkv", ".mov", ".m4v", ".webm", ".mpg", ".mpeg")
_NUMBER = re.compile(r".*-(\d{6,})\.png")


class _Video:
    """A video that is read picture by picture; begun anew where an earlier picture is wanted."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._begin()

    def _begin(self) -> None:
        self._capture: Any = cv2.VideoCapture(str(self._path))
        self._next, self._shown = 0, -1
        self._last: NDArray[np.uint8] | None = None
        if not self._capture.isOpened():
            raise InputError(f"{self._path} is no video that can be decoded: convert it, for example to .mp4 or .avi")

    def picture(self, number: int) -> NDArray[np.uint8]:
        """Return picture `number`, (H, W, 3) RGB; InputError where the video is shorter."""
        if number == self._shown and self._last is not None:
            return self._last
        if number < self._next:
            self._begin()
        while self._next <= number:
            if not (self._capture.grab() if self._next < number else self._decode()):
                raise InputError(f"{self._path} ends after {self._next} pictures: number {number} is not there")
            self._next += 1
        assert self._last is not None
        self._shown = number
        return self._last

    def _decode(self) -> bool:
        taken, picture = self._capture.read()
        if taken:
            self._last = np.ascontiguousarray(picture[..., ::-1])
        return bool(taken)

    @cached_property
    def times_s(self) -> list[float]:
        """When each picture that can be decoded was taken, s, by its own stamp, else by the rate; from the first on.

        How many pictures there are, what the file says of itself may be wrong.
        """
        self._begin()
        stamps, rate = [], self._capture.get(cv2.CAP_PROP_FPS)
        while self._capture.grab():
            stamps.append(self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000)
        self._begin()
        if any(later <= earlier for earlier, later in pairwise(stamps)) and rate > 0:
            stamps = [number / rate for number in range(len(stamps))]
        return [stamp - stamps[0] for stamp in stamps]


_reading = threading.Lock()


@lru_cache(maxsize=4)
def _video(path: Path, _changed_ns: int) -> _Video:
    return _Video(path)


def _opened(path: Path) -> _Video:
    return _video(path, path.stat().st_mtime_ns)


def is_frame_of_video(path: Path) -> bool:
    """Whether a path names a picture of a video that is there."""
    video = path.parent
    return bool(video.suffix.lower() in VIDEO_SUFFIXES and _NUMBER.fullmatch(path.name) and video.is_file())


def frame_of_video(path: Path) -> NDArray[np.uint8]:
    """Return the (H, W, 3) RGB picture that `is_frame_of_video` names; InputError where it cannot be decoded."""
    named = _NUMBER.fullmatch(path.name)
    assert named is not None
    with _reading:
        return _opened(path.parent).picture(int(named[1])).copy()


def frames_of_video(path: Path) -> list[Path]:
    """Return the names of all pictures of a video, in order; InputError where there is none."""
    with _reading:
        count = len(_opened(path).times_s)
    if not count:
        raise InputError(f"{path} has no picture that can be decoded: convert it, for example to .mp4 or .avi")
    return [path / f"{path.stem}-{number:06}.png" for number in range(count)]


def times_of_video(path: Path) -> list[float]:
    """Return when each picture of a video was taken, s from the first on."""
    with _reading:
        return _opened(path).times_s
