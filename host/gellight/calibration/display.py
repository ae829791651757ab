"""What a calibration shows of itself while it runs, safe to read from any thread."""

import threading
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from gellight.calibration.records import LiveCoverage, Record, ShownCircle, Verdict

STEPS = ("prepare", "reference", "pixel_size", "lens", "presses", "fit", "verify")
"""in this order, "lens" only where the user has a pin grid; then "finished", and "aborted" or "failed" at any time"""
Picture = NDArray[np.uint8]


class Progress(Record):
    """How far a step is; empty before it has begun to count."""

    done: int | float | None = None
    wanted: int | float | None = None
    unit: str | None = None
    loss: float | None = None
    """of the training"""


class Shown(TypedDict, total=False):
    """What a step shows with `Display.update`; see `Routine.snapshot`."""

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


class Display:
    """Text, figures and pictures for the user; `snapshot` is a consistent copy."""

    def __init__(self, steps: tuple[str, ...] = STEPS) -> None:
        """Begin idle; steps: those of this routine."""
        self.steps = steps
        self.shown = Shown(
            step="idle",
            instruction="Start when the sensor is warm and the gel is clean.",
            actions=("start",),
            progress=Progress(),
            awaiting="",
            problem="",
            press=None,
            coverage=None,
            advice="",
            verdict=None,
            bundle="",
        )
        self._version = 0
        self._figures: dict[str, Record] = {}
        self._pictures: dict[str, Picture] = {}
        self._reached = ""
        """the last of `steps`"""
        self._lock = threading.Lock()

    def update(self, **changes: Unpack[Shown]) -> None:
        """Replace what is named and count the version up."""
        with self._lock:
            self.shown.update(changes)
            self._reached = self.shown["step"] if self.shown["step"] in self.steps else self._reached
            self._version += 1

    def begin_step(self, step: str) -> None:
        """Name the step that begins, and clear what the last one showed."""
        self.update(step=step, progress=Progress(), problem="", press=None, advice="")

    def add_figures(self, name: str, figures: Record) -> None:
        """Add what was measured."""
        with self._lock:
            self._figures[name] = figures
            self._version += 1

    def show(self, **pictures: Picture) -> None:
        """Replace pictures, (H, W, 3) uint8 RGB."""
        with self._lock:
            self._pictures = {**self._pictures, **pictures}
            self._version += 1

    def pictures(self) -> dict[str, Picture]:
        """Return the newest pictures by name; nobody changes them later."""
        with self._lock:
            return dict(self._pictures)

    def snapshot(self) -> dict[str, Any]:
        """Return everything but the pictures, ready for JSON; see `Routine.snapshot`."""
        with self._lock:
            return {
                **{name: one.as_json() if isinstance(one, Record) else one for name, one in self.shown.items()},
                "version": self._version,
                "steps": self._step_states(),
                "actions": list(self.shown["actions"]),
                "figures": {name: figures.as_json() for name, figures in self._figures.items()},
                "pictures": sorted(self._pictures),
            }

    def _step_states(self) -> list[dict[str, str]]:
        step = self.shown["step"]
        reached = self.steps.index(self._reached) if self._reached else 0
        done = len(self.steps) if step == "finished" else reached
        return [
            {"name": name, "state": "done" if i < done else "now" if name == step else "to do"}
            for i, name in enumerate(self.steps)
        ]
