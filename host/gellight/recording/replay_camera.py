"""The camera of `replay://FILE`: a recording, at its own pace or another one.

Parameters of the URL, all optional: `speed` (2: twice as fast; 0: as fast as frames are taken), `start` (s from the
beginning of the recording), `loop=1` (begin again at the end).
"""

import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from gellight.base.allowed import query_of
from gellight.base.errors import CameraError, InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import FILE_NAME as PICTURE_STEPS
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

    bundle: Bundle

    def __init__(self, recording: Recording, *, url: str, chosen: ReplayUrl) -> None:
        """Begin where `chosen` says; InputError where nothing is recorded so late."""
        self.url, self.bundle = url, recording.bundle
        self.record = recording.first
        """of the frame that was read last"""
        self._recording, self._chosen = recording, chosen
        self.waits = chosen.speed == 0
        info = recording.first.info
        self.image_shape = (info.height, info.width)
        self._closing = threading.Event()
        self._last, self._offset = -1, 0
        self.zero = info.zero
        """identity of the bundle with the zero that the last frame was taken under"""
        self._begin()

    @property
    def bundle_files(self) -> Mapping[str, bytes]:
        """How its pictures are prepared already."""
        return {name: content for name, content in self._recording.bundle.files.items() if name == PICTURE_STEPS}

    def _begin(self) -> None:
        """Start from the first frame that is wanted."""
        records = self._recording.frames(self._chosen.start)
        if (first := next(records, None)) is None:
            raise InputError(f"{self._recording.path} ends before {self._chosen.start:g} s: begin earlier")
        self._records: Iterator[FrameRecord] = chain([first], records)
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
            self._begin()
            record = next(self._records, None)
            self._offset = self._last + 1 - (record.info.sequence if record else 0)
        if record is None:
            raise EndOfStream(f"{self.url} has delivered all of its frames")
        frame, self.record = record.camera_frame(str(self._recording.path)), record
        due_s = self._wait(frame.time_s)
        self._last, self.zero = frame.sequence + self._offset, record.info.zero
        return replace(frame, time_s=due_s, sequence=self._last, source=self.url)

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

    def hurry(self) -> None:
        """Wait no more: at a hundredth of the speed the next frame may be hours away."""
        self._closing.set()

    def close(self) -> None:
        """End."""
        self.hurry()


def open_replay(url: str) -> ReplayCamera:
    """Open `replay://FILE`; InputError, with the reason, for what is no recording or for an unknown parameter."""
    chosen = query_of(url, ReplayUrl)
    path = Path(unquote(url.removeprefix(f"{SCHEME}://").partition("?")[0]))
    return ReplayCamera(Recording(path), url=url, chosen=chosen)
