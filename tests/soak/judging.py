"""What has to hold all the time: the judge notes everything that breaks it."""

import ctypes
import gc
import logging
import os
import re
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import reduce
from operator import or_
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import CameraFrame, LightState
from gellight.frames.pose import ObjectPose
from tests.soak.hardware import Exposure, FragileSensor
from tests.soak.pressed_gel import read_number

logger = logging.getLogger(__name__)
TICK_S = 0.02
LATE_S = 0.01
"""a thread that wakes up later than this was kept from the processor"""
RECOVERY_S = 3.0
DARK_WITHIN_S = 1.5
"""a board that hears nothing goes dark after one second"""
STAMP_ERROR_S = 0.003
"""of the camera: 2 ms are assumed of it, and its stamps are whole microseconds"""


class Invariant(StrEnum):
    LABEL = "no wrong light label"
    LIGHT = "frames show the light that was set"
    FRESH = "no stale frame called new"
    WHOLE = "no torn frame delivered"
    RECOVERY = "recovery within 3 s"
    DARK = "LEDs dark when the host is gone"
    RECORDING = "recordings can be read"
    READER = "subscribers get frames in order"
    MEMORY = "memory bounded"
    HANDLES = "handles bounded"
    RUNNING = "the daemon goes on"
    FIRMWARE = "the firmware keeps to its timing"
    CALIBRATION = "presses of a calibration are kept, and where they were"
    POSE = "a pose is of an object that was touched before"


@dataclass(frozen=True)
class Violation:
    at_s: float
    """since the beginning of the run"""
    invariant: Invariant
    text: str


class Patience:
    """Measures for how long this process was kept from the processor: no fault of the product."""

    def __init__(self) -> None:
        self.starved_s = 0.0
        self._ended = threading.Event()
        threading.Thread(target=self._measure, name="patience", daemon=True).start()

    def _measure(self) -> None:
        before_s = time.monotonic()
        while not self._ended.wait(TICK_S):
            now_s = time.monotonic()
            late_s = now_s - before_s - TICK_S
            self.starved_s += late_s if late_s > LATE_S else 0.0
            before_s = now_s

    def close(self) -> None:
        self._ended.set()


class Judge:
    """Notes violations, of frames and of what others report. Safe to use from any thread."""

    def __init__(self, sensor: FragileSensor) -> None:
        self.violations: list[Violation] = []
        self.judged: Counter[Invariant] = Counter()
        """how often each was looked at: what was never judged did not hold"""
        self.frames = self.labels = 0
        """frames that were judged; clean labels among them"""
        self.newest_start_s = -np.inf
        """when the newest frame that was sound began, `time.monotonic`"""
        self._sensor = sensor
        self._begun_s = time.monotonic()
        self._sequence = self._number = self._object = -1
        self._lock = threading.Lock()

    def broken(self, invariant: Invariant, text: str) -> None:
        with self._lock:
            self.violations.append(Violation(time.monotonic() - self._begun_s, invariant, text))
        logger.error("%s: %s", invariant, text)

    def looked_at(self, *invariants: Invariant) -> None:
        with self._lock:
            self.judged.update(invariants)

    def not_judged(self) -> list[Invariant]:
        return [invariant for invariant in Invariant if not self.judged[invariant]]

    def begin_stream(self) -> None:
        """Begin with the frames of another daemon, which counts frames and objects anew."""
        self._sequence = self._object = -1

    def frame(self, frame: CameraFrame, *, light: NDArray[np.uint8] | None, groups: NDArray[np.uint8] | None) -> None:
        """Judge a frame that was delivered: under the still light (12, 3), or a sequence of groups (n, 12, 3)."""
        self.frames += 1
        self.looked_at(Invariant.WHOLE)
        try:
            number = read_number(frame.image)
        except InputError as error:
            self.broken(Invariant.WHOLE, str(error))
            return
        exposure = self._sensor.exposure(number)
        if exposure is None:
            self.broken(Invariant.WHOLE, f"frame {frame.sequence} shows number {number}, which was not exposed lately")
            return
        if self._is_new(frame, exposure) and self._is_lit(frame, exposure, light, groups):
            self.newest_start_s = exposure.start_s

    def pose(self, sequence: int, pose: ObjectPose | None) -> None:
        """Judge the pose of a frame, if it has one: its object was touched before, and is no earlier one."""
        if pose is None:
            return
        self.looked_at(Invariant.POSE)
        if pose.since_sequence > sequence:
            self.broken(Invariant.POSE, f"frame {sequence} has an object of frame {pose.since_sequence}")
        if pose.number < self._object:
            self.broken(Invariant.POSE, f"frame {sequence} has object {pose.number} after {self._object}")
        self._object = pose.number

    def _is_new(self, frame: CameraFrame, exposure: Exposure) -> bool:
        """Judge whether the frame is newer than the one before, and as new as it says."""
        self.looked_at(Invariant.FRESH)
        before, self._sequence = self._sequence, frame.sequence
        old, self._number = self._number, max(exposure.number, self._number)
        if frame.sequence <= before:
            self.broken(Invariant.FRESH, f"frame {frame.sequence} came after frame {before}")
        elif exposure.number <= old:
            self.broken(Invariant.FRESH, f"frame {frame.sequence} shows picture {exposure.number} after {old}")
        elif frame.time_s - exposure.start_s > STAMP_ERROR_S:
            newer_ms = (frame.time_s - exposure.start_s) * 1e3
            self.broken(Invariant.FRESH, f"frame {frame.sequence} is called {newer_ms:.1f} ms newer than it is")
        else:
            return True
        return False

    def _is_lit(
        self, frame: CameraFrame, exposure: Exposure, light: NDArray[np.uint8] | None, groups: NDArray[np.uint8] | None
    ) -> bool:
        if groups is None:
            if light is None:
                return True
            self.looked_at(Invariant.LIGHT)
            if (exposure.lights != light).any():
                self.broken(Invariant.LIGHT, f"frame {frame.sequence} was exposed under another light than was set")
                return False
            return True
        if frame.label is None or frame.label.state is not LightState.CLEAN:
            return True
        self.labels += 1
        self.looked_at(Invariant.LABEL)
        if (exposure.lights != groups[frame.label.group]).any():
            self.broken(Invariant.LABEL, f"frame {frame.sequence} is labelled clean, group {frame.label.group}")
            return False
        return True


FEWEST = 60
"""samples, one a second: a shorter run says nothing about memory"""
FIRST_RESTS = 2
"""rests that later ones are compared with"""
ALLOWED_MB = 4.0
"""the allocator may keep so much more from the third to the last quarter of a run"""


M_ARENA_MAX = -8
"""of `mallopt`, glibc's malloc.h"""


def one_arena() -> None:
    """Let all threads that begin from now on allocate from the same memory, where the C library has arenas.

    Each gets an arena else. What is free between what is kept in them went up and down by 100 MB in 50 connections to
    a simulated sensor, without any leak; from one arena the same 50 took 102.0 to 102.1 MB.
    """
    library = ctypes.CDLL(None)
    if hasattr(library, "mallopt"):
        library.mallopt(M_ARENA_MAX, 1)


@dataclass(frozen=True)
class Holdings:
    at_s: float
    memory_mb: float
    """resident, not of files, without what the allocator keeps of memory that was given back"""
    files: int
    threads: tuple[str, ...]
    """their names, without numbers"""
    children: int

    @classmethod
    def now(cls, at_s: float) -> "Holdings":
        """Look at this process, without what Python or the C library would free later."""
        gc.collect()
        getattr(ctypes.CDLL(None), "malloc_trim", int)(0)
        lines = Path("/proc/self/status").read_text().splitlines()
        resident = next(int(line.split()[1]) for line in lines if line.startswith("RssAnon:")) / 1e3
        tasks = list(Path("/proc/self/task").iterdir())
        children = sum(len((task / "children").read_text().split()) for task in tasks if (task / "children").exists())
        alive = {int(task.name) for task in tasks}  # Python goes on listing threads of libraries that have ended
        names = [thread.name for thread in threading.enumerate() if thread.native_id in alive]
        threads = tuple(re.sub(r"[-_]?\d+", "", name) for name in names)
        return cls(at_s, resident, len(os.listdir("/proc/self/fd")), threads, children)  # noqa: PTH208


def memory_growth_mb(samples: Sequence[Holdings]) -> tuple[float, float]:
    """Return how much more memory the last quarter of a run took than the third, and how much of that may be noise.

    Nothing where there are fewer than `FEWEST` samples. Medians are compared. Noise: `ALLOWED_MB` and three times the
    larger median deviation of the two.
    """
    if len(samples) < FEWEST:
        return 0.0, ALLOWED_MB
    memory = np.array([sample.memory_mb for sample in samples])
    middle, three_quarters = len(memory) // 2, len(memory) * 3 // 4
    third, last = memory[middle:three_quarters], memory[three_quarters:]
    spread = max(float(np.median(np.abs(part - np.median(part)))) for part in (third, last))
    return float(np.median(last) - np.median(third)), ALLOWED_MB + 3 * spread


def handle_growth(rests: Sequence[Holdings]) -> dict[str, int]:
    """Return what is more at the last rest, with no daemon running, than at any of the first two; threads by name."""
    *first, last = [_counted(rest) for rest in (*rests[:FIRST_RESTS], rests[-1])]
    return dict(last - reduce(or_, first))


def _counted(rest: Holdings) -> Counter[str]:
    return Counter(files=rest.files, children=rest.children, **Counter(f"thread {name}" for name in rest.threads))
