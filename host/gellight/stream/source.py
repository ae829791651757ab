"""What a program reads tactile frames from, in the daemon's process (sensor.py) or in another (subscription.py)."""

from __future__ import annotations

import json
import logging
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Iterator
from math import inf
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, InputError, StreamError
from gellight.bundle.bundle import Bundle
from gellight.daemon.calls import Call, Drag, Mode, Press, Release, Track, Zero, light_of, made
from gellight.frames.camera import EndOfStream
from gellight.frames.frames import TactileFrame
from gellight.frames.status import SensorStatus

logger = logging.getLogger(__name__)
PATIENCE_S = 10.0  # chosen: with the next frame; a camera that starts needs some seconds
CALLBACK_S = 10.0
"""that the function of a listener may take when the source is closed"""
BACKLOG = 32
"""frames that wait for a reader who wants them all"""


class NoFrameError(StreamError):
    """No frame came in time, as while a sensor is unplugged; frames may come again."""


class FrameSource(ABC):
    """Tactile frames of one sensor; an iterator, synchronous and asynchronous, and a context manager.

    By default each frame is the newest there is. `frame.provenance.dropped` counts those that were passed over.
    """

    def __init__(self, *, patience_s: float, every: bool = False) -> None:
        """Let readers wait `patience_s` for a frame before NoFrameError; every: one reader gets them all."""
        self._patience_s, self._every = patience_s, every
        self._sequence: int | None = None
        self._listening: list[threading.Thread] = []
        self._closing = threading.Event()
        self._problem: Exception | None = None
        """what ended a callback"""
        self._since_s = -inf
        """frames that were exposed before (`CameraFrame.time_s`) show the sensor as it was before the last command"""

    # ---- frames ----

    def next_frame(self, timeout_s: float | None = None) -> TactileFrame:
        """Wait for the next frame; None: as long as `patience_s` says.

        After `press`, `drag`, `release`, `light`, `mode` or `zero` that is the first one that was exposed after it,
        some tenths of a second later; those of before are passed over. Of files it is the next picture.
        Raises NoFrameError, a StreamError that says what is wrong, after that time; another StreamError when the daemon
        is gone; EndOfStream after the last frame of images or of a recording.
        """
        if self._every and self._listening and threading.current_thread() not in self._listening:
            raise InputError("with every=True the listener gets all frames: open another source to read them here")
        wait_s = self._patience_s if timeout_s is None else timeout_s
        until_s = time.monotonic() + wait_s
        try:
            frame = self._take(wait_s)
            while frame.camera_frame.time_s < self._since_s:
                frame = self._take(max(until_s - time.monotonic(), 0.0))
        except TimeoutError:
            raise NoFrameError(f"no frame for {wait_s:g} s: {self._why_none()}") from None
        sequence = frame.camera_frame.sequence
        before, self._sequence = self._sequence, sequence
        return frame if before is None else frame.with_dropped(max(sequence - before - 1, 0))

    def __iter__(self) -> Iterator[TactileFrame]:
        """Yield frames until the images are used up or the source is closed."""
        while (frame := self._next_if_any()) is not None:
            yield frame

    async def __aiter__(self) -> AsyncIterator[TactileFrame]:
        """Yield frames as `__iter__` does, without keeping the event loop from other work."""
        import asyncio  # takes a tenth of a start, and who calls this has it

        while (frame := await asyncio.to_thread(self._next_if_any)) is not None:
            yield frame

    def _next_if_any(self) -> TactileFrame | None:
        """Return the next frame, None after the last one and once the source is closed."""
        try:
            return None if self._closing.is_set() else self.next_frame()
        except EndOfStream:
            return None
        except (StreamError, CameraError):
            if self._closing.is_set():
                return None
            raise

    def listen(
        self, use: Callable[[TactileFrame], object], on_error: Callable[[Exception], object] | None = None
    ) -> None:
        """Call `use` with each frame, in a thread of its own, until the source is closed.

        Where no frame comes for `patience_s`, as while the sensor is unplugged, `on_error` is called with NoFrameError,
        each time anew, and `use` again when frames come again; without `on_error` that is logged once an absence. What
        ends the frames (EndOfStream, StreamError when the daemon is gone), and what `use` or `on_error` raises, ends
        the calls: `on_error` is called with it, else it is logged, and `close` raises it. InputError for a second
        reader of a source that gives every frame.
        """
        if self._every and self._listening:
            raise InputError("with every=True a source has one listener: open another source for the second one")
        thread = threading.Thread(target=self._hand_on, args=(use, on_error), name="listen", daemon=True)
        self._listening.append(thread)
        thread.start()

    def _hand_on(self, use: Callable[[TactileFrame], object], on_error: Callable[[Exception], object] | None) -> None:
        try:
            for frame in self._lasting(on_error):
                use(frame)
        except Exception as error:
            self._problem = self._problem or error
            if on_error is None:
                logger.error("a callback is called no more: %s", error)
            else:
                on_error(error)

    def _lasting(self, on_error: Callable[[Exception], object] | None) -> Iterator[TactileFrame]:
        """Yield frames until the source is closed; tell of each time that none came within `patience_s`."""
        absent = False
        while not self._closing.is_set():
            try:
                frame = self.next_frame()
            except NoFrameError as error:
                if on_error is not None:
                    on_error(error)
                elif not absent:
                    logger.warning("%s", error)
                absent = True
            except Exception:
                if self._closing.is_set():
                    return
                raise
            else:
                absent = False
                yield frame

    # ---- commands ----

    @abstractmethod
    def status(self) -> SensorStatus:
        """Return what the daemon knows of the sensor."""

    @property
    @abstractmethod
    def bundle(self) -> Bundle:
        """The calibration bundle in use, with the zero in use."""

    def light(self, colours: NDArray[np.uint8] | None) -> None:
        """Show (12, 3) uint8 RGB on the LEDs, or the light of the bundle again (None); depth needs the latter."""
        self._command(light_of(colours))

    def mode(self, mode: str) -> None:
        """Go on in another mode: network or photometric; InputError where that cannot be."""
        self._command(made(Mode, mode=mode))

    def zero(self) -> None:
        """Set the zero of the depth to the gel as it is now: nothing touches it; InputError where that is not so."""
        self._command(Zero())

    def track(self, on: bool) -> None:
        """Give frames the pose of the object that touches, or no more; for all readers of the sensor."""
        self._ask(made(Track, on=on))

    def press(self, object_name: str, depth_mm: float, x_mm: float = 0.0, y_mm: float = 0.0) -> None:
        """Press an object into a simulated gel; InputError for a real one."""
        self._command(made(Press, object=object_name, depth_mm=depth_mm, x_mm=x_mm, y_mm=y_mm))

    def drag(self, x_mm: float, y_mm: float, turn_rad: float = 0.0) -> None:
        """Move what is pressed into a simulated gel sideways, to x, y from where it was pressed, and turn it.

        InputError where nothing is pressed, and for a real gel.
        """
        self._command(made(Drag, x_mm=x_mm, y_mm=y_mm, turn_rad=turn_rad))

    def release(self) -> None:
        """Lift the object off the simulated gel."""
        self._command(Release())

    def _command(self, call: Call) -> None:
        """Have it done, and pass over the frames of before."""
        self._since_s = float(json.loads(self._ask(call)).get("time_s", 0.0))

    # ---- the two kinds ----

    @abstractmethod
    def _ask(self, call: Call) -> bytes:
        """Have a call carried out, and return the answer; InputError says why it cannot be."""

    @abstractmethod
    def _take(self, timeout_s: float) -> TactileFrame:
        """Wait for a frame; raises TimeoutError."""

    @abstractmethod
    def _why_none(self) -> str:
        """Return why no frame comes, and what to do."""

    @abstractmethod
    def _release_all(self) -> None:
        """Let go of whatever is held."""

    def close(self) -> None:
        """End; raises what ended a callback of `listen` before, StreamError for one that does not return."""
        self._closing.set()
        self._release_all()
        for thread in self._listening:
            if thread is not threading.current_thread():
                thread.join(CALLBACK_S)
                if thread.is_alive() and self._problem is None:
                    self._problem = StreamError(
                        f"what listen calls has not returned for {CALLBACK_S:g} s: it runs on, the rest is closed"
                    )
        if self._problem is not None:
            problem, self._problem = self._problem, None
            raise problem

    def __enter__(self) -> Self:
        """Give the source itself."""
        return self

    def __exit__(self, *problem: object) -> None:
        """Close."""
        self.close()
