"""What a calibration shows of itself while it runs, safe to read from any thread."""

import threading
from dataclasses import dataclass, field
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from gellight.lab.calibration.records import LiveCoverage, ShownCircle, Verdict
from gellight.lab.calibration.state import Steps
from gellight.lab.report.record import Record

STEPS = ("prepare", "reference", "pixel_size", "presses", "fit", "verify")
"""in this order; then "finished", and "aborted" or "failed" at any time"""
Picture = NDArray[np.uint8]


class Progress(Record):
    """How far a step is; empty before it has begun to count."""

    done: int | float | None = None
    wanted: int | float | None = None
    unit: str | None = None
    loss: float | None = None
    """of the training"""


class Changes(TypedDict, total=False):
    """What `Display.update` may replace; see `Routine.snapshot`."""

    step: str
    instruction: str
    actions: tuple[str, ...]
    progress: Progress
    awaiting: str
    problem: str
    press: ShownCircle | None
    coverage: LiveCoverage | None
    advice: str
    verdict: Verdict | None
    bundle: str


@dataclass(eq=False)
class Display:
    """Text, figures and pictures for the user; `snapshot` is a consistent copy."""

    step: str = "idle"
    instruction: str = "Start when the sensor is warm and the gel is clean."
    actions: tuple[str, ...] = ("start",)
    progress: Progress = field(default_factory=Progress)
    awaiting: str = ""
    problem: str = ""
    press: ShownCircle | None = None
    coverage: LiveCoverage | None = None
    advice: str = ""
    verdict: Verdict | None = None
    bundle: str = ""
    version: int = 0
    figures: Steps = field(default_factory=Steps)
    _pictures: dict[str, Picture] = field(default_factory=dict)
    _reached: str = ""
    """the last of `STEPS`"""
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def update(self, **changes: Unpack[Changes]) -> None:
        """Replace what is named and count the version up."""
        with self._lock:
            for name, value in changes.items():
                setattr(self, name, value)
            self._reached = self.step if self.step in STEPS else self._reached
            self.version += 1

    def begin_step(self, step: str) -> None:
        """Name the step that begins, and clear what the last one showed."""
        self.update(step=step, progress=Progress(), problem="", press=None, advice="")

    def add_figures(self, name: str, figures: Record) -> None:
        """Add what was measured."""
        with self._lock:
            setattr(self.figures, name, figures)
            self.version += 1

    def show(self, **pictures: Picture) -> None:
        """Replace pictures, (H, W, 3) uint8 RGB."""
        with self._lock:
            self._pictures = {**self._pictures, **pictures}
            self.version += 1

    def pictures(self) -> dict[str, Picture]:
        """Return the newest pictures by name; nobody changes them later."""
        with self._lock:
            return dict(self._pictures)

    def snapshot(self) -> dict[str, Any]:
        """Return everything but the pictures, ready for JSON; see `Routine.snapshot`."""
        with self._lock:
            return {
                "version": self.version,
                "step": self.step,
                "steps": self.step_states(),
                "instruction": self.instruction,
                "actions": list(self.actions),
                "progress": self.progress.as_json(),
                "awaiting": self.awaiting,
                "problem": self.problem,
                "figures": {name: step.as_json() for name, step in self.figures if isinstance(step, Record)},
                "press": self.press and self.press.as_json(),
                "coverage": self.coverage and self.coverage.as_json(),
                "advice": self.advice,
                "verdict": self.verdict and self.verdict.as_json(),
                "bundle": self.bundle,
                "pictures": sorted(self._pictures),
            }

    def step_states(self) -> list[dict[str, str]]:
        """Return name and state of each step: "done", "now" or "to do"."""
        done = STEPS.index(self._reached) if self._reached else 0
        done = len(STEPS) if self.step == "finished" else done
        return [
            {"name": name, "state": "done" if i < done else "now" if name == self.step else "to do"}
            for i, name in enumerate(STEPS)
        ]
