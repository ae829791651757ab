"""Whether a network can be trained here: found out by training a tiny one, before anybody presses."""

import numpy as np

from gellight.base.errors import TrainingError, first_line
from gellight.lab.training.child import Check, go_on
from gellight.lab.training.table import PressTable
from gellight.lab.training.trainer import TrainerName
from gellight.lab.training.training import TrainingOptions, train
from gellight.sensor.findings import Finding, ok, warning

_rehearsed: dict[TrainerName, str] = {}
"""what trained, by what was asked for: a process tries it once"""


def rehearse(trainer: TrainerName = "numpy", *, check: Check = go_on) -> str:
    """Train a network of one unit for one epoch; return what trained it, with its version.

    Raises TrainingError where nothing can be trained.
    """
    if trainer not in _rehearsed:
        _rehearsed[trainer] = _trained_by(trainer, check)
    return _rehearsed[trainer]


def _trained_by(trainer: TrainerName, check: Check) -> str:
    rows = np.random.default_rng(0).uniform(0, 1, (8, 7)).astype(np.float32)
    table = PressTable(rows=rows, image=np.arange(8, dtype=np.int32) % 2, image_size=(2, 2))
    try:
        _, record = train(table, TrainingOptions(recipe="fast", width=1, epochs=1, trainer=trainer), check=check)
    except (TrainingError, OSError) as error:
        raise TrainingError(
            f"no network can be trained here ({first_line(error)}): repair what is named there, or choose "
            "the other --trainer"
        ) from error
    return str(record["trainer"])


def check_trainer() -> Finding:
    """Look whether a network can be trained."""
    try:
        return ok("training", f"{rehearse()} trains networks")
    except TrainingError as error:
        text, _, remedy = str(error).rpartition(": ")
        return warning("training", text, remedy)
