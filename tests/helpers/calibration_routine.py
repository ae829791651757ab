"""The calibration routine on the simulated sensor: opened, run to its end, waited for."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gellight.frames.camera import Camera
from gellight.lab.calibration.choices import RoutineOptions, ToolSizes
from gellight.lab.calibration.routine import Routine
from gellight.lab.training.training import TrainingOptions
from gellight.opening import open_camera

GEOMETRY = {"image_width_px": 320, "image_height_px": 240, "pixel_size_mm": 0.1176}
URL = "sim://?fps=500&board=0&led_spread=0.05"
LIT = "sim://?fps=500&led_spread=0.05"
SOON = TrainingOptions(recipe="fast", epochs=4)
"""for the 300,000 rows that lights show: as often as the recipe sees what presses alone show"""
PATIENCE_S = 280.0
"""for a machine that does other things, too; nothing is judged by it"""


def camera(url: str = URL) -> Camera:
    return open_camera(url, geometry=GEOMETRY)


def options(folder: Path, **changes: Any) -> RoutineOptions:
    """Return what a short routine is told, with `changes`, sizes of tools among them."""
    sizes = {name: changes.pop(name) for name in ToolSizes.model_fields if name in changes}
    few: dict[str, Any] = {"presses": 12, "verifications": 2, "cylinder_presses": 2, "reference_frames": 8}
    few |= {"training": TrainingOptions(recipe="fast"), "tools": ToolSizes.of(sizes), **changes}
    return RoutineOptions(out=folder / "bundle", sensor="one", **few)


def finished(routine: Routine) -> dict[str, Any]:
    """Start a routine that needs nobody, and wait for its end."""
    routine.act("start")
    routine.join(PATIENCE_S)
    assert routine.ended
    return routine.snapshot()


def wait_for(routine: Routine, what: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Return the first snapshot of which `what` is true; AssertionError if none comes."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        snapshot = routine.snapshot()
        if what(snapshot):
            return snapshot
        assert not routine.ended, snapshot["problem"]
        time.sleep(0.01)
    raise AssertionError(f"did not come: {routine.snapshot()}")
