"""Buffers shared with the driver: the newest picture comes out, everything else is counted.

The driver fills queued buffers in order and throws pictures away while none is queued. So the newest filled buffer is
the newest picture only while another buffer is still empty. When all are full, all may be old, and the stream waits for
the next picture. So even a slow reader never gets an old one.
"""

import errno
from ctypes import Structure
from dataclasses import asdict, dataclass
from mmap import mmap
from typing import cast

from gellight.base.errors import CameraError
from gellight.frames.status import CameraStatus
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.errors import (
    GONE,
    POLL_ERROR,
    POLL_IN,
    Kernel,
    StalledError,
    UnpluggedError,
    explaining,
    explanation,
)
from gellight.sensor.v4l2.formats import Ask

BUFFERS = 4  # chosen: one is filled while the others wait to be read
BAD_LIMIT = 60
"""number of unusable pictures in a row that is a fault"""
OLDEST_STAMP_S = 2.0  # chosen: an older stamp is of another clock
_LARGEST_STEP = 2**31  # half of what 32 bits count: a longer step goes back


@dataclass(frozen=True, kw_only=True)
class Picture:
    """One picture as the driver delivered it."""

    data: bytes
    sequence: int
    """counts the pictures the camera took, lost ones included"""
    stamp_s: float
    """when the driver says it was taken, s of CLOCK_MONOTONIC"""
    stamp_is_start: bool
    """the stamp is said to be the start of the exposure, else the end of the frame"""
    stamp_is_sound: bool
    """it is on the right clock, later than the one before, and not in the future"""
    arrived_s: float
    """when it was taken from the driver"""
    absent_s: float
    """when it surely was not there yet: the driver had no picture"""
    repeats: bool
    """it is byte for byte the picture before"""


@dataclass
class Counts:
    """What became of the pictures of a stream."""

    delivered: int = 0
    skipped: int = 0
    """good, but a newer one was there"""
    lost: int = 0
    """never came: gaps in the sequence"""
    duplicated: int = 0
    """the same sequence number or time came again; not delivered"""
    identical: int = 0
    """byte for byte the picture before: the camera repeats itself, or sees no light at all"""
    damaged: int = 0
    """marked as damaged by the driver, or empty"""
    corrupt: int = 0
    """could not be decoded, or not whole"""
    wrong_stamps: int = 0
    """whose time cannot be true"""

    def as_json(self) -> CameraStatus:
        """Return the counts by name, as they stand in a camera's status."""
        return cast(CameraStatus, asdict(self))

    def __add__(self, other: "Counts") -> "Counts":
        """Return the sum, count by count."""
        return Counts(**{name: count + getattr(other, name) for name, count in asdict(self).items()})


class Stream:
    """A running stream; a device has one at most."""

    def __init__(self, kernel: Kernel, descriptor: int, ask: Ask, path: str, *, buffers: int = BUFFERS) -> None:
        """Map `buffers` buffers and start; raises BusyError where another programme streams.

        The driver may give more or fewer buffers. Nothing stays mapped where it fails.
        """
        self._kernel, self._descriptor, self._ask, self._path = kernel, descriptor, ask, path
        self._memory: list[mmap] = []
        self._last: tuple[int, float] | None = None
        self._last_data = b""
        self._absent_s = kernel.clock()
        self.counts = Counts()
        try:
            with explaining(path, "to start its stream"):
                self._start(buffers)
        except BaseException:
            self._unmap()
            raise

    def _start(self, buffers: int) -> None:
        request = v.RequestBuffers(count=buffers, type=v.CAPTURE, memory=v.MMAP)
        self._ask(v.REQBUFS, request)
        if request.count < 2:  # with one the driver would have none to fill while it is read
            raise CameraError(f"{self._path} has memory for {request.count} pictures only: ask for a smaller size")
        for index in range(request.count):
            buffer = v.Buffer(index=index, type=v.CAPTURE, memory=v.MMAP)
            self._ask(v.QUERYBUF, buffer)
            self._memory.append(self._kernel.mmap(self._descriptor, buffer.length, buffer.m.offset))
            self._ask(v.QBUF, buffer)
        self._ask(v.STREAMON, v.Int(v.CAPTURE))

    def _unmap(self) -> None:
        for memory in self._memory:
            memory.close()
        self._memory = []

    def newest(self, timeout_s: float) -> Picture:
        """Wait for the newest picture, at most `timeout_s` for each one that may still come.

        Raises UnpluggedError, or StalledError where the camera is there and nothing usable comes.
        """
        for _ in range(BAD_LIMIT):
            self._wait(timeout_s)
            picture = self._drain()
            if picture is not None:
                self.counts.delivered += 1
                return picture
        raise StalledError(
            f"{self._path} delivers only damaged pictures ({self.counts.as_json()}): use another cable or USB port, "
            "without a hub"
        )

    def _wait(self, timeout_s: float) -> None:
        events = self._kernel.poll(self._descriptor, timeout_s)
        if events & POLL_IN and not events & POLL_ERROR:
            return
        if not self.plugged():
            raise UnpluggedError(f"the camera at {self._path} was unplugged: plug it in again")
        why = "stopped its stream" if events else f"sent no picture for {timeout_s:g} s"
        raise StalledError(f"the camera at {self._path} is there but {why}: it is started anew, or unplug it")

    def plugged(self) -> bool:
        """Ask the driver whether the camera is still there: a poll error alone does not show that."""
        try:
            self._ask(v.QUERYCAP, v.Capability())
        except OSError as error:
            return error.errno not in GONE
        return True

    def _drain(self) -> Picture | None:
        """Take all filled buffers, queue them again, and return the newest good picture if it is known to be new."""
        newest, taken = None, 0
        while (buffer := self._dequeue()) is not None:
            taken += 1
            picture = self._judge(buffer)
            with explaining(self._path, "to take a buffer back"):
                self._ask(v.QBUF, v.Buffer(index=buffer.index, type=v.CAPTURE, memory=v.MMAP))
            if picture is not None and not (picture.repeats and newest is not None):
                self.counts.skipped += newest is not None
                newest = picture
            if taken == len(self._memory):
                break
        if taken >= len(self._memory) and newest is not None:
            self.counts.skipped += 1
            return None
        return newest

    def _dequeue(self) -> v.Buffer | None:
        buffer, asked_s = v.Buffer(type=v.CAPTURE, memory=v.MMAP), self._kernel.clock()
        try:
            self._ask(v.DQBUF, buffer)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EINTR):
                self._absent_s = asked_s if error.errno == errno.EAGAIN else self._absent_s
                return None
            if error.errno == errno.EIO and self.plugged():
                self.counts.damaged += 1
                return None
            raise explanation(self._path, "to deliver a picture", error) from error
        return buffer

    def _judge(self, buffer: v.Buffer) -> Picture | None:
        """Count what a buffer holds; return it where it is a good picture that was not there before."""
        stamp_s = buffer.timestamp.seconds + buffer.timestamp.microseconds * 1e-6
        if not self._advance(buffer.sequence, stamp_s):
            self.counts.duplicated += 1
            return None
        if buffer.flags & v.FLAG_ERROR or not buffer.bytesused:
            self.counts.damaged += 1
            return None
        now_s = self._kernel.clock()
        monotonic = buffer.flags & v.TIMESTAMP_MASK == v.TIMESTAMP_MONOTONIC
        sound = monotonic and now_s - OLDEST_STAMP_S <= stamp_s <= now_s and self._stamp_grows
        self.counts.wrong_stamps += not sound
        data = bytes(self._memory[buffer.index][: buffer.bytesused])
        repeats, self._last_data = data == self._last_data, data
        self.counts.identical += repeats
        return Picture(
            data=data,
            sequence=buffer.sequence,
            stamp_s=stamp_s,
            stamp_is_start=buffer.flags & v.SOURCE_MASK == v.SOURCE_SOE,
            stamp_is_sound=sound,
            arrived_s=now_s,
            absent_s=self._absent_s,
            repeats=repeats,
        )

    def _advance(self, sequence: int, stamp_s: float) -> bool:
        """Note a sequence number; False where the same picture was there already."""
        self._stamp_grows = True
        if self._last is not None:
            step = (sequence - self._last[0]) % 2**32
            if step == 0 or step >= _LARGEST_STEP or (step == 1 and stamp_s == self._last[1]):
                return False
            self.counts.lost += step - 1
            self._stamp_grows = stamp_s > self._last[1]
        self._last = sequence, stamp_s
        return True

    def close(self) -> None:
        """Stop; the buffers go back to the driver. A camera that was unplugged is no error."""
        self._ask_to_stop(v.STREAMOFF, v.Int(v.CAPTURE))
        self._unmap()  # the driver does not free what is mapped
        self._ask_to_stop(v.REQBUFS, v.RequestBuffers(count=0, type=v.CAPTURE, memory=v.MMAP))

    def _ask_to_stop(self, request: int, argument: Structure) -> None:
        try:
            self._ask(request, argument)
        except OSError as error:
            if error.errno not in GONE:
                raise explanation(self._path, "to stop its stream", error) from error
