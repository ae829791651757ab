"""The presses in a stream of frames: of each the gel while it stood still, when it was pressed deepest."""

import queue
import threading
from collections import deque
from collections.abc import Callable, Iterator
from math import isnan
from typing import Literal, TypeVar

import numpy as np

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame
from gellight.frames.pixel_grid import over_gel
from gellight_scan.contact_view import ContactView, Floats

LEAST_MM = 0.08
"""deep: less is no press"""
STILL_MM = 0.003
"""mean change of the depth from frame to frame, over what is pressed; noise makes a third of that"""
STILL_FRAMES = 3
MOST_FRAMES = 8
"""whose mean is taken"""
STEP_PX = 4
"""between the pixels that are compared"""
T = TypeVar("T")
Phase = Literal["press", "hold", "lift"]
"""what a hand has to do next"""


class PressWatcher:
    """Takes the frames of one sensor in turn."""

    def __init__(self) -> None:
        """Begin with the gel untouched."""
        self._still: deque[Floats] = deque(maxlen=MOST_FRAMES)
        self._best: ContactView | None = None
        self._best_mm = 0.0

    @property
    def settled(self) -> bool:
        """Whether the press under way has been still for long enough: it may be lifted."""
        return self._best is not None

    @property
    def phase(self) -> Phase:
        """What the hand has to do next: press, hold what touches still, or lift it."""
        return "lift" if self.settled else "hold" if self._still else "press"

    def feed(self, frame: TactileFrame) -> ContactView | None:
        """Take a frame; return the press that ended with it. InputError for a frame without depth."""
        if isnan(frame.contact.indentation_mm) or frame.provenance is None:
            raise InputError("the sensor has no calibration, so there is no depth to scan: calibrate it first")
        if frame.exposures is not None and frame.exposures.moved:
            return None
        if frame.contact.indentation_mm < LEAST_MM:
            return self.end()
        if self._still and _change_mm(self._still[-1], frame.depth_mm) > STILL_MM:
            self._still.clear()
        self._still.append(frame.depth_mm)
        if len(self._still) >= STILL_FRAMES:
            self._note(frame)
        return None

    def _note(self, frame: TactileFrame) -> None:
        assert frame.provenance is not None
        deep_mm = float(np.mean(self._still[-1][::STEP_PX, ::STEP_PX].clip(min=0)))
        if deep_mm >= 0.98 * self._best_mm:
            depth = np.asarray(np.mean(self._still, axis=0, dtype=np.float64), np.float32)
            made = frame.provenance
            depth = over_gel(depth, made.camera_height_mm)
            self._best = ContactView(depth, made.pixel_size_mm, made.calibration, made.gel_thickness_mm)
            self._best_mm = max(deep_mm, self._best_mm)

    def end(self) -> ContactView | None:
        """Return the press under way as far as it was still, None where there is none; begin anew."""
        best = self._best
        self._still.clear()
        self._best, self._best_mm = None, 0.0
        return best


def presses_in(
    frames: Iterator[TactileFrame], most: int = 0, tell: Callable[[Phase], None] = lambda phase: None
) -> Iterator[ContactView]:
    """Yield up to `most` presses, 0: all; `tell` hears whenever the hand has something else to do.

    It hears that a press was lifted before that press is out: who sees the press never waits for its lifting.
    """
    watcher, count, told = PressWatcher(), 0, "press"
    for frame in frames:
        view = watcher.feed(frame)
        if watcher.phase != told:
            tell(watcher.phase)
        told = watcher.phase
        if view is not None:
            count += 1
            yield view
            if count == most:
                return
    if (last := watcher.end()) is not None:
        yield last


def ahead(views: Iterator[T]) -> Iterator[T]:
    """Yield the presses that a thread looks for: none is missed while another one is joined."""
    found: queue.SimpleQueue[T | BaseException | None] = queue.SimpleQueue()

    def look() -> None:
        try:
            for view in views:
                found.put(view)
            found.put(None)
        except BaseException as error:
            found.put(error)

    threading.Thread(target=look, name="presses", daemon=True).start()
    while (view := found.get()) is not None:
        if isinstance(view, BaseException):
            raise view
        yield view


def _change_mm(one: Floats, other: Floats) -> float:
    if one.shape != other.shape:
        return float("inf")
    one, other = one[::STEP_PX, ::STEP_PX], other[::STEP_PX, ::STEP_PX]
    pressed = (one > LEAST_MM / 2) | (other > LEAST_MM / 2)
    return float(np.abs(one - other)[pressed].mean()) if pressed.any() else 0.0
