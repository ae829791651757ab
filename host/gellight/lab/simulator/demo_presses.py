"""The presses of the demo by finite elements, computed ahead: `gellight simulate demo`."""

from dataclasses import dataclass

from gellight.base.errors import InputError
from gellight.lab.simulator.gel_models import gel_model, kept_folder
from gellight.lab.simulator.memory import check_memory
from gellight.lab.simulator.stage import presses_of_the_demo
from gellight.lab.simulator.sweep import SweepOptions, Task, run_all
from sim_reference.deformation import NotConverged
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import press_object


@dataclass(frozen=True, kw_only=True)
class PressedAhead:
    """What is there now."""

    folder: str
    presses: int
    not_found: list[str]
    """object, depth and reason of each press that finite elements did not find"""


def press_ahead(resolution_mm: float, geometry: SensorGeometry, options: SweepOptions) -> PressedAhead:
    """Compute the presses of the demo that are not kept yet; each is kept as soon as it is found.

    Raises InputError for a mesh that does not fit the memory, and where presses cannot be kept.
    """
    check_memory(resolution_mm, geometry, options.workers)
    tasks = [
        Task(f"{name} {depth:g} mm", keep_press, (name, depth, geometry, resolution_mm))
        for name, depth in presses_of_the_demo()
    ]
    for task in tasks:  # What counts is whether the press is kept, which may have been removed since.
        options.store.path(task.key).unlink(missing_ok=True)
    reasons = run_all(tasks, options)
    missing = [f"{task.label}: {reason}" for task, reason in zip(tasks, reasons, strict=True) if reason]
    return PressedAhead(folder=str(kept_folder()), presses=len(tasks) - len(missing), not_found=missing)


def keep_press(name: str, depth_mm: float, geometry: SensorGeometry, resolution_mm: float) -> str:
    """Compute a press if it is not kept; return why it was not found, "" if it was."""
    try:
        press_object(name, depth_mm, geometry, model=gel_model("fem", resolution_mm))
    except InputError as error:
        if not isinstance(error.__cause__, NotConverged):
            raise
        return str(error.__cause__)
    return ""
