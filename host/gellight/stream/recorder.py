"""Records what a running daemon captures, in a thread of its own; a disk that is slow or full does not disturb it."""

import errno
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Collection
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from gellight.base.errors import InputError
from gellight.base.mailbox import Mailbox
from gellight.daemon.session import SensorSession
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.measures import MapOnRequest
from gellight.reconstruction.force_file import ForceRecord
from gellight.recording.frame_record import NO_SERIES
from gellight.recording.kinds import DepthKind
from gellight.recording.recording_file import RecordingWriter
from gellight.stream.publisher import name_of_sensor
from gellight.stream.source import PATIENCE_S

logger = logging.getLogger(__name__)
BACKLOG = 64
"""frames that wait for the disk"""
RESERVE_BYTES = 100 << 20
"""left free on the disk: the recording ends before, whole"""
LOOK_S = 1.0  # chosen: between two looks at the room on the disk
RATE_FRAMES = 8  # chosen: tell the period; a quarter of a second at 30 frames/s
LATE_S = 1.0
"""a frame that waited longer is written unpacked: this computer is too slow to pack all"""
POLL_S = 0.05  # chosen: how late an end is noticed
SHORT_S = 600.0
"""room for less than this is warned of"""


@dataclass
class RecordingStatus:
    """How far a recording is."""

    frames: int = 0
    depths: int = 0
    size_bytes: int = 0
    lost: int = 0
    """camera frames that the disk was too slow for"""
    left_s: float | None = None
    """how long the disk has room for, at the present rate; None before that is known"""
    ended: str = ""
    """why nothing more is recorded; empty while it goes on"""


class Recorder:
    """Records a daemon that runs; a context manager that finishes the file."""

    def __init__(
        self,
        daemon: SensorSession,
        path: Path,
        *,
        name: str = "",
        depth: DepthKind = DepthKind.NONE,
        maps: Collection[MapOnRequest] = (),
        frames: int = 0,
    ) -> None:
        """Begin the file at `path`; InputError where that cannot be: a full disk, series of exposures.

        name: of the sensor, by default its own. frames: after which nothing more is recorded, 0 for none. maps: of each
        tactile frame, to be recorded too; InputError for the pressure of a sensor whose bundle has no constant for it.
        """
        self._daemon, self.path, self._most = daemon, path, frames
        if daemon.joins_exposures:
            raise InputError(NO_SERIES)
        if MapOnRequest.PRESSURE in maps and ForceRecord.in_bundle(daemon.bundle) is None:
            raise InputError(
                "the bundle has no constant for the force, so there is no pressure to record: find it with "
                "`gellight calibrate force`, or record without"
            )
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path.parent} cannot be made ({error.strerror}): choose another folder") from error
        free = _free_bytes(path.parent)
        if free < 2 * RESERVE_BYTES:
            raise InputError(f"{path.parent} has {free / 1e6:.0f} MB left: free some space, or record elsewhere")
        self._writer = RecordingWriter(path, name or name_of_sensor(daemon.camera), depth=depth, maps=maps)
        self.status = RecordingStatus()
        self._first: int | None = None
        """sequence number of the first frame that was written, and"""
        self._last = -1
        """of the last one"""
        self._waiting = deque[TactileFrame]()
        """whose pictures are not written yet, nor ever where the recording ends before"""
        self._ended = threading.Event()

    def bytes_a_minute(self) -> float:
        """Return how large the recording becomes, by a frame that is not recorded; it waits for some frames."""
        first = self._daemon.next_frame(-1, PATIENCE_S)
        frame = first
        while frame.camera_frame.sequence < first.camera_frame.sequence + RATE_FRAMES:
            frame = self._daemon.next_frame(frame.camera_frame.sequence, PATIENCE_S)
        taken, before = frame.camera_frame, first.camera_frame
        period_s = (taken.time_s - before.time_s) / (taken.sequence - before.sequence)
        return self._writer.bytes_of(frame) * 60 / max(period_s, 1e-3)

    def __enter__(self) -> Self:
        """Start."""
        with ExitStack() as copies:
            captured = copies.enter_context(self._daemon.captured.subscribe(BACKLOG, lasting=True))
            delivered = copies.enter_context(self._daemon.delivered.subscribe(BACKLOG, lasting=True))
            work = copies.pop_all(), captured, delivered
        self._daemon.recording = self.path.name
        self._thread = threading.Thread(target=self._record, args=work, name="record", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *problem: object) -> None:
        """Finish the file."""
        self._ended.set()
        self._thread.join()

    @property
    def ended(self) -> bool:
        """Whether nothing more is recorded."""
        return bool(self.status.ended)

    def _record(self, copies: ExitStack, captured: Mailbox[CameraFrame], delivered: Mailbox[TactileFrame]) -> None:
        with copies:  # what nobody writes any more is not kept either
            self._write(captured, delivered)
        self._finish()

    def _write(self, captured: Mailbox[CameraFrame], delivered: Mailbox[TactileFrame]) -> None:
        begun_s = looked_s = time.monotonic()
        number = felt = 0
        last: int | None = None
        """number of the last frame that is written; None until the recording ends: frames go on to come"""
        try:
            while last is None or number < last:
                number = self._take_frame(captured, number)
                felt = self._take_felt(delivered, felt)
                if time.monotonic() - looked_s > LOOK_S:
                    looked_s = time.monotonic()
                    self._look(looked_s - begun_s)
                if self.status.ended or 0 < self._most <= self.status.frames:
                    break
                if last is None and self._ended.is_set():
                    last = captured.newest
            self._take_felt(delivered, felt)
        except OSError as error:
            self._end(f"the recording stopped: {'the disk is full' if error.errno == errno.ENOSPC else error.strerror}")
        except Exception as error:
            logger.exception("the recording failed")
            self._end(f"the recording failed: {error}")

    def _take_frame(self, captured: Mailbox[CameraFrame], number: int) -> int:
        """Write the next camera frame, if one comes soon; return the number of the last one."""
        try:
            taken, frame = captured.take(number, POLL_S)
        except TimeoutError:
            return number
        except Exception:  # the frames have ended, and who runs the daemon is told why
            self._ended.set()
            return number
        self.status.lost += taken - number - 1
        assert frame.stamp is not None, "a daemon stamps every frame"
        kept_up = self._daemon.camera.waits or time.monotonic() - frame.time_s < LATE_S
        self._writer.add(frame, frame.stamp, packed=kept_up)
        self._first = frame.sequence if self._first is None else self._first
        self._last = frame.sequence
        self.status.frames += 1
        return taken

    def _take_felt(self, delivered: Mailbox[TactileFrame], number: int) -> int:
        """Write what is wanted of the frames that were reconstructed meanwhile; return the number of the last one."""
        while self._writer.of_tactile_frames and self._first is not None:
            try:
                number, frame = delivered.take(number, 0)
            except Exception:  # none is there, or the frames have ended
                break
            if frame.camera_frame.sequence >= self._first:
                self._waiting.append(frame)
        while self._waiting and self._waiting[0].camera_frame.sequence <= self._last:
            self._writer.add_tactile(self._waiting.popleft())
            self.status.depths += 1
        return number

    def _look(self, since_s: float) -> None:
        """Flush, and look how much room there is."""
        self._writer.flush()
        size, free = self._writer.path.stat().st_size, _free_bytes(self._writer.path.parent) - RESERVE_BYTES
        before, rate = self.status.left_s, size / since_s
        self.status.size_bytes, self.status.left_s = size, max(free, 0) / rate if rate else None
        if free <= 0:
            self._end("the recording stopped: the disk is nearly full")
        elif before is None and self.status.left_s is not None and self.status.left_s < SHORT_S:
            logger.warning("%s has room for %.0f s more", self._writer.path.parent, self.status.left_s)

    def _end(self, why: str) -> None:
        logger.error("%s", why)
        self.status.ended = why

    def _finish(self) -> None:
        self._daemon.recording = None
        try:
            self._writer.close()
            self.status.size_bytes = self._writer.path.stat().st_size
        except OSError as error:
            self._end(f"the end of {self._writer.path} was not written ({error.strerror}); what is before can be read")


def _free_bytes(folder: Path) -> int:
    facts = os.statvfs(folder)
    return facts.f_bavail * facts.f_frsize
