"""Who calibrates the sensor while it is maltreated, then lets it rest; and what has to hold of that."""

import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from gellight.base.errors import GellightError, InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.bundle.store import BundleStore
from gellight.daemon.calibration_service import CalibrationRequest, CalibrationService
from gellight.daemon.session import SensorSession
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.routine import Install, Routine
from gellight.lab.calibration.state import discard, state_in
from gellight.lab.simulator.scene import Press
from gellight.lab.simulator.virtual_hand import CYLINDER_DEPTH_MM, CYLINDER_PLACES_MM, spread
from gellight.lab.training.training import TrainingOptions
from tests.soak.hardware import SERIAL
from tests.soak.judging import Invariant, Judge
from tests.soak.pressed_gel import PressedGel, place_px

POLL_S = 0.05
PRESSES, VERIFICATIONS, CYLINDERS, REFERENCE_FRAMES = 10, 3, 2, 8
FARTHEST_MM = (9.0, 6.0)
"""from the middle: the whole contact is in the picture"""
DEPTHS_MM = (0.8, 1.4)
CIRCLE_PX = 1.5
"""by which the circle of a press may lie beside the press"""
IN_FLIGHT = 10
"""frames that may have been exposed before the light was set anew"""


@dataclass
class Work:
    calibrations: int = 0
    """that passed their own check"""
    judged_bad: int = 0
    """by their own check"""
    taken_up: int = 0
    """interrupted calibrations that were gone on with"""
    circles: int = 0
    """of presses of calibrations that were judged"""
    worst_circle_px: float = 0.0


class Calibrating:
    """Calibrates the sensor of a running daemon, again and again; what a fault interrupts is gone on with."""

    def __init__(self, gel: PressedGel, daemon: SensorSession, judge: Judge, folder: Path, work: Work) -> None:
        """Keep a calibration in `folder`, where a later one goes on with it."""
        self._gel, self._daemon, self._judge, self._work = gel, daemon, judge, work
        self._folder, self._bundle = folder / "calibration", folder / "calibrated"
        self.service = CalibrationService(
            daemon, store=BundleStore(folder / "bundles"), folder=self._folder, make_routine=self._routine
        )
        self.progress = 0
        """counts what was achieved"""
        self._current: Routine | None = None
        self._seen: tuple[Any, ...] = ()
        self._count = self._judged = 0

    def _routine(self, request: CalibrationRequest, install: Install) -> Routine:
        options = RoutineOptions(
            out=self._bundle, sensor=SERIAL, presses=request.presses, verifications=VERIFICATIONS, overwrite=True,
            cylinder_presses=CYLINDERS, reference_frames=REFERENCE_FRAMES,
            training=TrainingOptions(recipe="fast"),
        )  # fmt: skip
        self._current = Routine(self._daemon.camera, options, self._folder, install=self._passed)
        return self._current

    def _passed(self, bundle: Bundle) -> None:
        """Read what would be put into service, and begin anew after it; installing is what `kills` tries."""
        if load_bundle(self._bundle).identity != bundle.identity:
            self._judge.broken(Invariant.CALIBRATION, "the bundle that was written is not the one that passed")
        self._work.calibrations += 1
        discard(self._folder)

    def _kept(self) -> int:
        state = state_in(self._folder)
        return len(state.presses) if state else 0

    def run(self, ended: threading.Event) -> None:
        """Begin a calibration or go on with one; follow it to its end, or until told to end."""
        kept = self._kept()
        try:
            self.service.begin(CalibrationRequest(presses=PRESSES))
        except GellightError:  # the sensor is away, or not yet set after the last one
            ended.wait(10 * POLL_S)
            return
        assert self._current is not None
        self._work.taken_up += kept > 0
        if (left := self._kept()) < kept:
            self._judge.broken(Invariant.CALIBRATION, f"{left} of {kept} presses are left after a fault")
        while self.service.calibrating and not ended.is_set():
            self._serve(self._current, self._current.snapshot())
            ended.wait(POLL_S)
        if not self.service.calibrating:
            self._conclude(self._current.snapshot())

    def _conclude(self, end: dict[str, Any]) -> None:
        if end["step"] == "finished" and not end["verdict"]["passed"]:
            self._work.judged_bad += 1
        if "please report" in end["problem"]:
            self._judge.broken(Invariant.CALIBRATION, end["problem"])

    def _serve(self, routine: Routine, now: dict[str, Any]) -> None:
        with suppress(InputError):  # it may have gone on meanwhile
            if "accept" in now["actions"]:
                routine.act("accept")
            elif "next" in now["actions"] and now["step"] in ("prepare", "reference"):
                routine.act("next")
        due = now["step"], now["awaiting"], now["progress"].get("done")
        if due == self._seen:
            return
        self._seen = due
        self.progress += 1
        if now["awaiting"] == "press":
            self._press(now["step"])
        elif now["awaiting"] == "lift":
            self._judge_circle(now.get("press"))
            self._gel.lift()

    def _press(self, step: str) -> None:
        self._count += 1
        if step == "pixel_size":
            place = CYLINDER_PLACES_MM[self._count % len(CYLINDER_PLACES_MM)]
            self._gel.press("CYLINDER", CYLINDER_DEPTH_MM, *place)
        else:
            press_ball(self._gel, self._count)

    def _judge_circle(self, shown: dict[str, Any] | None) -> None:
        """Judge a press that was taken, while it is still in the gel."""
        pressed = self._gel.pressed
        if shown and shown["state"] == "taken" and shown["number"] != self._judged and pressed is not None:
            self._judged = shown["number"]
            judge_circle(self._judge, self._work, shown, pressed)


class Working:
    """Calibrates until it is told to rest; a context manager."""

    def __init__(self, gel: PressedGel, calibrating: Calibrating, judge: Judge) -> None:
        self._gel, self._calibrating, self._judge = gel, calibrating, judge
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="hand", daemon=True)
        self.calibrating = True
        """whether the light may be another than the bundle's"""

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *problem: object) -> None:
        self.rest()
        self._thread.join()

    @property
    def progress(self) -> int:
        """Counts what a calibration has achieved."""
        return self._calibrating.progress

    def rest(self) -> None:
        self._ended.set()

    def _run(self) -> None:
        try:
            with self._calibrating.service:
                while not self._ended.is_set():
                    self._calibrating.run(self._ended)
        except Exception as error:
            self._judge.broken(Invariant.RUNNING, f"who works with the sensor was stopped: {error!r}")
        finally:
            self._gel.lift()
            self.calibrating = False


def press_ball(gel: PressedGel, number: int) -> Press:
    """Press the ball at the next place of a sequence that fills the view evenly."""
    gel.lift()
    u, v, w = spread(0, number)
    (x, y), (low, high) = FARTHEST_MM, DEPTHS_MM
    return gel.press("BALL", round(low + (high - low) * w, 1), x * (2 * u - 1), y * (2 * v - 1))


def judge_circle(judge: Judge, work: Work, shown: dict[str, Any], pressed: Press) -> None:
    """Judge whether the circle of a press of a calibration lies on the press."""
    judge.looked_at(Invariant.CALIBRATION)
    x, y = place_px(pressed)
    off_px = float(np.hypot(shown["center_x_px"] - x, shown["center_y_px"] - y))
    work.circles, work.worst_circle_px = work.circles + 1, max(off_px, work.worst_circle_px)
    if off_px > CIRCLE_PX:
        judge.broken(Invariant.CALIBRATION, f"press {shown['number']} is taken {off_px:.1f} px beside the ball")
