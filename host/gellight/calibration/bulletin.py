"""What a calibration shows of itself while it runs, safe to read from any thread."""

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

STEPS = ("prepare", "reference", "pixel_size", "lens", "presses", "fit", "verify")
"""in this order, "lens" only where the user has a pin grid; then "finished", and "aborted" or "failed" at any time"""
Picture = NDArray[np.uint8]


@dataclass
class Bulletin:
    """The board on which the routine writes; `snapshot` is a consistent copy."""

    steps: tuple[str, ...] = STEPS
    """those of this routine"""
    step: str = "idle"
    instruction: str = "Start when the sensor is warm and the gel is clean."
    actions: tuple[str, ...] = ("start",)
    progress: dict[str, Any] = field(default_factory=dict)
    awaiting: str = ""
    problem: str = ""
    figures: dict[str, Any] = field(default_factory=dict)
    press: dict[str, Any] | None = None
    coverage: dict[str, Any] | None = None
    advice: str = ""
    verdict: dict[str, Any] | None = None
    bundle: str = ""
    reached: str = ""
    """the last of `steps`"""
    version: int = 0
    _pictures: dict[str, Picture] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def post(self, **news: Any) -> None:
        """Replace what is named and count the version up."""
        with self._lock:
            for name, value in news.items():
                if not hasattr(self, name):
                    raise AttributeError(f"a bulletin has no {name}")
                setattr(self, name, value)
            self.reached = self.step if self.step in self.steps else self.reached
            self.version += 1

    def note(self, name: str, figures: Any) -> None:
        """Add the figures of one step."""
        self.post(figures={**self.figures, name: figures})

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
        """Return everything but the pictures, ready for JSON."""
        with self._lock:
            done = self.steps.index(self.reached) if self.reached else 0
            done = len(self.steps) if self.step == "finished" else done
            steps = [
                {"name": name, "state": "done" if i < done else "now" if name == self.step else "to do"}
                for i, name in enumerate(self.steps)
            ]
            return {
                "version": self.version,
                "step": self.step,
                "steps": steps,
                "instruction": self.instruction,
                "actions": list(self.actions),
                "progress": dict(self.progress),
                "awaiting": self.awaiting,
                "problem": self.problem,
                "figures": dict(self.figures),
                "press": dict(self.press) if self.press else None,
                "coverage": dict(self.coverage) if self.coverage else None,
                "advice": self.advice,
                "verdict": dict(self.verdict) if self.verdict else None,
                "bundle": self.bundle,
                "pictures": sorted(self._pictures),
            }
