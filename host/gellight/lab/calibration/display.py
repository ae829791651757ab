"""What a calibration shows of itself while it runs, safe to read from any thread."""

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from gellight.lab.calibration.records import ShownCircle, StepFigures, Verdict
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


class Shown(Record):
    """Text and figures for the user: one value, replaced whole."""

    version: int = 0
    """counts changes"""
    step: str = "idle"
    """or one of `STEPS`, "finished", "aborted" or "failed" """
    reached: str = Field(default="", exclude=True)
    """the last of `STEPS`"""
    instruction: str = "Start when the sensor is warm and the gel is clean."
    """what the user is to do now, a sentence or two"""
    actions: tuple[str, ...] = ("start",)
    """that `Routine.act` takes now"""
    progress: Progress = Progress()
    awaiting: str = ""
    """ "press" when the gel is watched for one, "lift" when it has to become free"""
    problem: str = ""
    """why the last thing was refused, with the remedy; empty when all is well"""
    figures: Steps = Steps()
    """what was measured; of the ball presses while they come in"""
    press: ShownCircle | None = None
    """the last one"""
    advice: str = ""
    """what is missing most, or "enough" """
    verdict: Verdict | None = None
    bundle: str = ""
    """path of what was written"""

    def as_json(self) -> dict[str, Any]:
        """Return it ready for JSON; what is unknown, and how often a check was refused, is left out."""
        return self.model_dump(mode="json", exclude_none=True, exclude={"figures": {"refused_checks"}})

    def step_states(self) -> list[dict[str, str]]:
        """Return name and state of each step: "done", "now" or "to do"."""
        done = STEPS.index(self.reached) if self.reached else 0
        done = len(STEPS) if self.step == "finished" else done
        return [
            {"name": name, "state": "done" if i < done else "now" if name == self.step else "to do"}
            for i, name in enumerate(STEPS)
        ]


class Display:
    """Keeps what is shown, and pictures beside it."""

    def __init__(self) -> None:
        """Show that nothing has begun."""
        self.shown = Shown()
        self._pictures: dict[str, Picture] = {}
        self._lock = threading.Lock()

    def update(self, **changes: Any) -> None:
        """Replace fields of `Shown` by name, and count the version up."""
        with self._lock:
            self._replace(**changes)

    def begin_step(self, step: str) -> None:
        """Name the step that begins, and clear what the last one showed."""
        self.update(step=step, reached=step, progress=Progress(), problem="", press=None, advice="")

    def add_figures(self, figures: StepFigures) -> None:
        """Add what was measured."""
        with self._lock:
            self._replace(figures=self.shown.figures.model_copy(update={figures.step: figures}))

    def show(self, **pictures: Picture) -> None:
        """Replace pictures, (H, W, 3) uint8 RGB."""
        with self._lock:
            self._pictures = {**self._pictures, **pictures}
            self._replace()

    def pictures(self) -> dict[str, Picture]:
        """Return the newest pictures by name; nobody changes them later."""
        return dict(self._pictures)

    def snapshot(self) -> dict[str, Any]:
        """Return everything but the pictures, ready for JSON; see `Routine.snapshot`."""
        with self._lock:
            shown, pictures = self.shown, sorted(self._pictures)
        return {**shown.as_json(), "steps": shown.step_states(), "pictures": pictures}

    def _replace(self, **changes: Any) -> None:
        self.shown = Shown(**{**dict(self.shown), **changes, "version": self.shown.version + 1})
