"""Frames in, depth out: a capture thread, a reconstruction thread, and between them a mailbox that keeps the latest.

A camera never waits for the reconstruction: a frame that is not taken in time is replaced by a newer one and counted
as dropped, so what comes out is as fresh as the machine allows. Files do wait (`Camera.waits`): the next picture is
read when the last one is being reconstructed, and with `every` it is delivered when the reader has asked for it.

What ends either thread (the last image of a folder, a camera that fails) is raised where frames are waited for. A
sensor that was unplugged ends nothing: while it is away the status says so, and nobody gets a frame from before.
"""

import getpass
import logging
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from gellight.base.errors import CameraError, InputError
from gellight.base.locking import FairLock
from gellight.base.mailbox import Mailbox
from gellight.bundle.bundle import Bundle
from gellight.daemon.statistics import Statistics
from gellight.frames.camera import Camera, EndOfStream, ReconnectingError
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame, CaptureStamp, TactileFrame

logger = logging.getLogger(__name__)

NOBODY_ASKED = -2
"""in place of a sequence number; who has no frame yet asks after -1"""
POLL_S = 0.5
"""how often a waiting thread looks whether it should stop"""
TIMEOUT_S = 20.0
"""as long as a scene of the simulated sensor may take, and longer than any camera"""


class FrameThreads:
    """The threads of a running sensor, and what they hand on."""

    def __init__(
        self,
        camera: Camera,
        reconstruct: Callable[[CameraFrame], TactileFrame],
        zeroed: Callable[[], Bundle],
        *,
        every: bool = False,
        realtime: bool = False,
    ) -> None:
        """Take the frames of `camera`, which the caller closes after `stop`. zeroed: returns the bundle, with the zero,
        that is in use now.

        every: where the camera waits, deliver a frame only when `note_asked` was called for it, so that none is missed.
        realtime: let both threads run before all other programs (SCHED_FIFO).
        """
        self._every = every and camera.waits
        self._realtime = realtime
        self._camera, self._reconstruct_frame, self._zeroed = camera, reconstruct, zeroed
        self.pause_s = 0.0
        """between two reconstructions"""
        self.captured: Mailbox[CameraFrame] = Mailbox()
        self.delivered: Mailbox[TactileFrame] = Mailbox()
        self.statistics = Statistics()
        self._ended = threading.Event()
        self._problems: dict[str, str] = {}
        """by the name of what has it"""
        self._away: str | None = None
        self._taken = threading.Event()
        """set when the frame that was captured last is being reconstructed"""
        self._asked_after, self._asked = NOBODY_ASKED, threading.Event()
        """the sequence number after which a frame was asked for last"""
        self._newest = self._discard_until = -1
        """camera sequence numbers: the last that came, and the last that must not be delivered any more"""
        self._flush_count = 0
        """how often what came before was thrown away"""
        self._capturing, self._reconstructing = FairLock(), FairLock()
        self._handing_on = threading.Lock()
        """held while a frame is delivered or the old ones are thrown away"""
        self._threads = [
            threading.Thread(target=self._capture, name="capture", daemon=True),
            threading.Thread(target=self._reconstruct, name="reconstruct", daemon=True),
        ]

    def start(self) -> None:
        """Start the threads; InputError where the system does not let them run first."""
        for thread in self._threads:
            thread.start()
        if self._realtime:
            run_first(self._threads[:2])

    def stop(self) -> None:
        """Stop the threads; who waits for a frame gets a CameraError."""
        self._ended.set()
        self._camera.hurry()
        for mailbox in (self.captured, self.delivered):
            mailbox.close(CameraError("the daemon was stopped"))
        try:
            self._join()
        except BaseException:  # Ctrl-C for the second time: the camera is closed next, and nobody may read it then
            self._join()
            raise

    def _join(self) -> None:
        for thread in self._threads:
            if thread.ident is not None:  # it was started
                thread.join()

    @property
    def ended(self) -> bool:
        """Whether no frame comes any more."""
        return self._ended.is_set()

    @property
    def problem(self) -> str | None:
        """What is wrong now, or what ended the frames; None while all is well."""
        return next(iter([*self._problems.values(), self._away]), None)

    def note_asked(self, after_sequence: int) -> None:
        """Let a camera that waits go on: a reader has everything up to this sequence number."""
        if after_sequence > self._asked_after:
            self._asked_after = after_sequence
            self._asked.set()

    def add_periodic(self, look: Callable[[TactileFrame], object], period_s: float) -> None:
        """Let a thread of its own look at the newest frame every `period_s`; to be called before `start`.

        What `look` raises is a problem until a later look succeeds.
        """
        name, job = look.__name__.strip("_"), self._look_now_and_then
        self._threads.append(threading.Thread(target=job, args=(look, period_s), name=name, daemon=True))

    def flush(self) -> None:
        """Deliver none of the frames that came until now: they show what was.

        The pictures of files show nothing of it: they are reconstructed anew.
        """
        with self._handing_on:
            self._flush_count += 1
            self.delivered.clear()
            if not self._camera.waits:
                self._discard_until = self._newest
                self.captured.clear()

    @contextmanager
    def halted(self) -> Iterator[None]:
        """Let camera and reconstruction rest between two frames; no frame from before is reconstructed afterwards."""
        with self._capturing, self._reconstructing:
            try:
                yield
            finally:
                self.flush()

    def note(self, name: str, problem: str | None) -> None:
        """Show what is wrong with something, and log it once; None: nothing any more."""
        if problem is None:
            self._problems.pop(name, None)
            return
        if self._problems.get(name) != problem:
            logger.error("%s: %s", name, problem)
        self._problems[name] = problem

    def _capture(self) -> None:
        try:
            while self._every and self._camera.waits and self._asked_after == NOBODY_ASKED and not self.ended:
                self._asked.wait(POLL_S)  # else who begins to listen a moment later would miss the first pictures
            while not self.ended:
                with self._capturing:
                    self._capture_one()
                while self._camera.waits and not (self.ended or self._taken.wait(POLL_S)):
                    pass
        except Exception as error:
            self._end(error, self.captured)

    def _capture_one(self) -> None:
        try:
            frame = self._camera.read()
        except ReconnectingError as error:
            self._leave(str(error))
            return
        with self._handing_on:
            self._away, self._newest = None, frame.sequence
            self.statistics.note_captured(frame)
            self._taken.clear()
            unix_s = time.time() - (time.monotonic() - frame.time_s)
            self.captured.put(replace(frame, stamp=CaptureStamp(zeroed=self._zeroed(), unix_s=unix_s)))

    def _leave(self, why: str) -> None:
        if self._away is None:
            logger.warning("%s", why)
        self._away = why
        self.flush()

    def _reconstruct(self) -> None:
        number = 0
        try:
            while not self._ended.wait(self.pause_s):
                try:
                    number, frame = self.captured.take(number, POLL_S)
                except TimeoutError:
                    continue
                self._taken.set()
                self._deliver(frame)
                self._wait_until_asked(frame)
        except Exception as error:
            self._end(error, self.captured, self.delivered)
            self._ended.set()

    def _deliver(self, camera_frame: CameraFrame) -> None:
        with self._reconstructing:
            if camera_frame.sequence <= self._discard_until:
                return
            frame = self._reconstruct_frame(camera_frame)
            with self._handing_on:
                if camera_frame.sequence > self._discard_until:
                    self.statistics.note_delivered(frame, time.monotonic())
                    self.delivered.put(frame)

    def _wait_until_asked(self, frame: CameraFrame) -> None:
        """With `every`, wait for the reader, outside the turn: what runs may be exchanged meanwhile.

        Then the frame that waits for the reader is of what ran before, and is reconstructed anew.
        """
        flushes = self._flush_count
        while self._every and not self.ended and self._asked_after < frame.sequence:
            self._asked.wait(POLL_S)
            self._asked.clear()
            if flushes != self._flush_count:
                flushes = self._flush_count
                self._deliver(frame)

    def _end(self, error: Exception, *mailboxes: Mailbox[CameraFrame] | Mailbox[TactileFrame]) -> None:
        """Raise `error` where frames of `mailboxes` are waited for, and note it once unless it is the proper end."""
        if not (isinstance(error, EndOfStream) or self.ended or str(error) in self._problems.values()):
            self.note(threading.current_thread().name, str(error))
        for mailbox in mailboxes:
            mailbox.close(error)

    def _look_now_and_then(self, look: Callable[[TactileFrame], object], period_s: float) -> None:
        name, number = threading.current_thread().name, 0
        while not self._ended.wait(period_s):
            try:
                number, frame = self.delivered.take(number, POLL_S)
            except TimeoutError:
                continue
            except Exception:
                return  # the frames have ended; the thread that ended it has noted why
            try:
                look(frame)
            except Exception as error:
                self.note(name, str(error))
            else:
                self.note(name, None)


class SharedCamera(CameraWrapper):
    """Gives frames whose exposure began after they were asked for, so under the light that was set before.

    Any thread but the daemon's may read it. The frames in between are not seen by this reader.
    """

    def __init__(self, camera: Camera, captured: Mailbox[CameraFrame]) -> None:
        """Wrap the camera of a daemon, which puts its frames into `captured`."""
        super().__init__(camera)
        self._captured = captured
        self._number = 0

    def read(self) -> CameraFrame:
        """Wait for a frame whose exposure began after this call; raises what ended the camera."""
        asked_s = time.monotonic()
        while (left_s := asked_s + TIMEOUT_S - time.monotonic()) > 0:
            try:
                self._number, frame = self._captured.take(self._number, left_s)
            except TimeoutError:
                break
            if frame.time_s >= asked_s:
                return frame
        raise CameraError(f"no frame of {self.url} for {TIMEOUT_S:g} s: check the camera and start again")

    def close(self) -> None:
        """Do nothing: the daemon closes its camera."""


PRIORITY = 10
"""of 1 to 99; the kernel's own threads for interrupts have 50"""


def run_first(threads: Iterable[threading.Thread]) -> None:
    """Give threads that run real-time priority; InputError where the system does not allow it, with the remedy."""
    if not hasattr(os, "sched_setscheduler"):
        raise InputError("real-time priority is there on Linux alone: leave service.realtime out")
    for thread in threads:
        try:
            os.sched_setscheduler(thread.native_id or 0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        except PermissionError:
            raise InputError(
                f"real-time priority is not allowed here: add the line `{getpass.getuser()} - rtprio {PRIORITY}` to "
                "/etc/security/limits.conf and log in again, or leave service.realtime out"
            ) from None
        except ProcessLookupError:  # it has ended already, and what ended it is raised where frames are waited for
            continue
