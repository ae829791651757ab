"""The calibration routine as a machine that a terminal, a page or a test drives.

    routine = Routine(camera, options, folder)
    routine.act("start")
    while not routine.ended:
        show(routine.snapshot(), routine.pictures())

It reads the camera in a thread of its own; nobody else may read that camera meanwhile. Whatever it learns it keeps in
`folder` at once, and a routine that is made on the same folder goes on where the last one stopped.
"""

import logging
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gellight.base.errors import GellightError, InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.display import Picture, Shown
from gellight.lab.calibration.fitting import fit
from gellight.lab.calibration.preparing import prepare, prepare_again
from gellight.lab.calibration.pressing import collect_presses
from gellight.lab.calibration.probing import measure_pixel_size
from gellight.lab.calibration.run import Aborted, CalibrationRun
from gellight.lab.calibration.untouched import compare_with_reference, take_reference
from gellight.lab.calibration.verifying import verify
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.lab.training.training import rehearse

logger = logging.getLogger(__name__)

Install = Callable[[Bundle], object]
"""Called with the bundle that passed, after it was written; what it raises becomes the problem of the routine."""
ACTIONS = ("start", "next", "correct", "drop", "accept", "abort")
ENDS = ("finished", "aborted", "failed")


class Routine:
    """One calibration of one sensor."""

    def __init__(
        self,
        camera: Camera,
        options: RoutineOptions,
        folder: Path,
        *,
        hand: VirtualHand | None = None,
        install: Install | None = None,
        anew: bool = False,
    ) -> None:
        """Prepare to calibrate the sensor behind `camera`, which stays open at the end.

        folder: where the state is kept; what an interrupted routine left there is taken up, or with `anew` removed.
        hand: presses where nobody does. install: puts a bundle that passed into service.
        Raises InputError or BundleError at once for what could not be written at the end, see `readiness`.
        """
        self._calibration = CalibrationRun(camera, options, folder, hand=hand, anew=anew)
        self._install = install
        self._thread: threading.Thread | None = None
        self.error: GellightError | None = None
        """what made it fail; None while it runs and after a good end"""

    @property
    def ended(self) -> bool:
        """Whether it is finished, aborted or failed."""
        return self.shown.step in ENDS and not (self._thread and self._thread.is_alive())

    @property
    def shown(self) -> Shown:
        """What is to be shown now."""
        return self._calibration.display.shown

    def snapshot(self) -> dict[str, Any]:
        """Return `shown` ready for JSON, what is unknown left out.

        Beside it, steps: list of {name, state: "done" | "now" | "to do"}, and pictures: names that `pictures` holds.
        """
        return self._calibration.display.snapshot()

    def pictures(self) -> dict[str, Picture]:
        """Return (H, W, 3) uint8 RGB by name, as they exist.

        live, untouched, cylinder and press (with their circles), difference (of that press from the untouched gel), and
        verify (the depth felt of the last fresh press).
        """
        return self._calibration.display.pictures()

    def act(self, action: str, **arguments: float) -> None:
        """Do what the user chose; returns at once, the thread carries it out.

        start: begin, or take up an interrupted routine. next: go on, where the instruction asks for it.
        correct(center_x_px, center_y_px, contact_radius_px): replace the circle of the last press. drop: forget the
        last press. accept: keep what was questioned. abort: stop; the state stays in the folder.
        Raises InputError for an action that is not offered now, or wrong arguments.
        """
        if action not in ACTIONS:
            raise InputError(f"no action {action!r}: choose one of {', '.join(ACTIONS)}")
        offered = self.shown.actions
        if action not in offered:
            raise InputError(f"{action} is not possible now: choose {' or '.join(offered) or 'nothing, but wait'}")
        if action == "start":
            self._start()
        else:
            self._calibration.submit(action, arguments)

    def stop(self) -> None:
        """Abort at the next frame, whatever is going on; the state stays in the folder."""
        self._calibration.submit("abort", {})

    def join(self, timeout_s: float | None = None) -> None:
        """Wait until it has ended, or for `timeout_s`."""
        if self._thread:
            self._thread.join(timeout_s)

    def _start(self) -> None:
        self._calibration.display.update(actions=("abort",), instruction="", problem="")
        self._thread = threading.Thread(target=self._run, name="calibration", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        display = self._calibration.display
        try:
            bundle = _run_steps(self._calibration)
            if self._install and bundle:
                self._install(bundle)
            self._end("finished", display.shown.instruction)
        except Aborted:
            self._end("aborted", "Stopped. What was measured is kept: you can go on from here.")
        except GellightError as error:
            self.error = error
            display.update(problem=str(error))
            self._end("failed", "The calibration stopped; nothing was replaced.")
        except Exception as error:
            logger.exception("calibration failed")
            self.error = GellightError(f"the calibration failed ({error}): please report it")
            display.update(problem=str(self.error))
            self._end("failed", "The calibration stopped; nothing was replaced.")

    def _end(self, step: str, instruction: str) -> None:
        self._calibration.display.update(step=step, instruction=instruction, actions=())


def _run_steps(run: CalibrationRun) -> Bundle | None:
    """Go through all steps and return the bundle that passed, None where the verdict was bad."""
    if run.folder.done("fit") is None:
        run.display.update(instruction="Whether a network can be trained here is tried out first.")
        rehearse(check=run.check_stopped)
    for step, first, again in (
        ("prepare", prepare, prepare_again),
        ("reference", take_reference, compare_with_reference),
        ("pixel_size", measure_pixel_size, None),
        ("presses", collect_presses, None),
        ("fit", fit, None),
    ):
        run.display.begin_step(step)
        if run.folder.done(step) is None:
            first(run)
        elif again:
            again(run)
        if figures := run.folder.done(step):
            run.display.add_figures(figures)
    run.display.begin_step("verify")
    return verify(run)
