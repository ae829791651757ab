"""A calibration routine that ends when the test says so, and the service that begins it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gellight.bundle.bundle import Bundle
from gellight.bundle.store import BundleStore
from gellight.daemon.calibration_service import CalibrationRequest, CalibrationService
from gellight.daemon.session import SensorSession
from gellight.lab.calibration.state import discard


class ScriptedRoutine:
    """Does nothing until `over` is set or it is stopped."""

    def __init__(self, request: CalibrationRequest, install: Callable[[Bundle], object]) -> None:
        self.request, self.install = request, install
        self.over = threading.Event()
        self.acts: list[Any] = []

    @property
    def ended(self) -> bool:
        return self.over.is_set()

    def snapshot(self) -> dict[str, Any]:
        return {"step": "finished" if self.ended else "presses"}

    def pictures(self) -> dict[str, Any]:
        return {"press": np.zeros((24, 32, 3), np.uint8)}

    def act(self, action: str, **arguments: float) -> None:
        self.acts.append((action, arguments))
        if action == "abort":
            self.over.set()

    def stop(self) -> None:
        self.act("abort")

    def join(self, timeout_s: float | None = None) -> None:
        assert self.over.wait(60)


@contextmanager
def served(
    daemon: SensorSession,
    folder: Path,
    routines: list[Any],
    make: Callable[[CalibrationRequest, Callable[[Bundle], object]], Any] = ScriptedRoutine,
) -> Iterator[CalibrationService]:
    """Serve calibrations of a sensor in a folder; `routines` has those that were begun, which end at the end."""

    def make_routine(request: CalibrationRequest, install: Callable[[Bundle], object]) -> Any:
        if request.anew:  # as a routine does, once all else was found to be possible
            discard(folder / "state")
        routines.append(make(request, install))
        return routines[-1]

    with CalibrationService(
        daemon, store=BundleStore(folder / "store"), folder=folder / "state", make_routine=make_routine
    ) as service:
        yield service
        for routine in routines:
            routine.over.set()
