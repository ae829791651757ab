"""The camera of `replay://FILE`: a recording, at its own pace or another one.

Parameters of the URL, all optional: `speed` (2: twice as fast; 0: as fast as frames are taken), `start` (s from the
beginning of the recording), `loop=1` (begin again at the end).
"""

import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from gellight.base.allowed import query_of
from gellight.base.errors import CameraError
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.frames import CameraFrame
from gellight.frames.status import CameraStatus
from gellight.recording.frame_record import FrameRecord
from gellight.recording.recording_file import Recording

SCHEME = "replay"


class ReplayUrl(BaseModel):
    """The parameters of a `replay://` URL."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    speed: float = Field(1.0, ge=0, le=1000)
    start: float = Field(0.0, ge=0)
    loop: bool = False


class ReplayCamera(Camera):
    """Gives the frames of a recording; they carry their bundle, so `calibration = auto` finds it."""

    def __init__(self, recording: Recording, *, url: str, chosen: ReplayUrl) -> None:
        """Begin where `chosen` says; InputError where nothing is recorded so late."""
        self.url, self.bundle = url, recording.bundle
        self._recording, self._chosen = recording, chosen
        self.waits = chosen.speed == 0
        info = recording.first.info
        self.image_shape = (info.height, info.width)
        self._closing = threading.Event()
        self._last, self._offset = -1, 0
        self.zero = info.zero
        """identity of the bundle with the zero that the last frame was taken under"""
        self._begin()

    def _begin(self) -> None:
        """Start from the first frame that is wanted."""
        self._records: Iterator[FrameRecord] = self._recording.frames(self._chosen.start)
        self._begun_s: float | None = None
        self._first_s = 0.0

    def read(self) -> CameraFrame:
        """Wait until the next frame is due; EndOfStream after the last, InputError for a damaged one.

        Its time is when it was due, so that its age is that of the computing.
        """
        if self._closing.is_set():
            raise CameraError(f"{self.url} is closed: open it again")
        record = next(self._records, None)
        if record is None and self._chosen.loop and self._last >= 0:
            self._offset = self._last + 1 - self._recording.first.info.sequence
            self._begin()
            record = next(self._records, None)
        if record is None:
            raise EndOfStream(f"{self.url} has delivered all of its frames")
        info = record.info
        image = record.image(str(self._recording.path))
        due_s = self._wait(info.time_s)
        self._last, self.zero = info.sequence + self._offset, info.zero
        light = None if info.light is None else np.array(info.light, np.uint8).reshape(-1, 3)
        return CameraFrame(
            image=image, time_s=due_s, sequence=self._last, source=self.url, light=light, label=info.label,
            dots=record.dots(str(self._recording.path)),
        )  # fmt: skip

    def _wait(self, time_s: float) -> float:
        """Wait until a frame that was taken at `time_s`, of the clock that does not jump, is due; return when."""
        if self._begun_s is None:
            self._begun_s, self._first_s = time.monotonic(), time_s
        if self._chosen.speed == 0:
            return time.monotonic()
        due_s = self._begun_s + (time_s - self._first_s) / self._chosen.speed
        self._closing.wait(max(due_s - time.monotonic(), 0.0))
        return min(due_s, time.monotonic())

    def status(self) -> CameraStatus:
        """Return what is replayed, ready for JSON."""
        return {"recording": str(self._recording.path), "whole": self._recording.whole, "speed": self._chosen.speed}

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Do nothing: the frames were taken long ago."""

    def close(self) -> None:
        """End; a `read` that waits ends too."""
        self._closing.set()


def open_replay(url: str) -> ReplayCamera:
    """Open `replay://FILE`; InputError, with the reason, for what is no recording or for an unknown parameter."""
    chosen = query_of(url, ReplayUrl)
    path = Path(unquote(url.removeprefix(f"{SCHEME}://").partition("?")[0]))
    return ReplayCamera(Recording(path), url=url, chosen=chosen)
