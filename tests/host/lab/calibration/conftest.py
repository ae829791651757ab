"""One calibration from end to end, kept on disk for all that begins with one."""

import fcntl
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.lab.calibration.routine import Routine
from gellight.lab.simulator.virtual_hand import VirtualHand
from tests.helpers.calibration_routine import LIT, camera, finished, options


class Remembering(CameraWrapper):
    """Remembers what it adopted last: so a sensor is set and lit again after it was unplugged."""

    adopted: tuple[dict[str, float], list[list[int]]] | None = None

    def adopt(self, controls: Mapping[str, float], colours: np.ndarray | None) -> None:
        super().adopt(controls, colours)
        self.adopted = dict(controls), colours.tolist()

    def read(self) -> CameraFrame:
        return self._camera.read()


def calibrate(folder: Path) -> None:
    """Let the virtual hand calibrate, with the light ring; installed bundles are listed."""
    installed: list[str] = []
    with Remembering(camera(LIT)) as sensor:
        hand = VirtualHand(sensor.stage)
        routine = Routine(
            sensor, options(folder), folder / "state", hand=hand, install=lambda bundle: installed.append(bundle.source)
        )
        snapshot = finished(routine)
    assert snapshot["step"] == "finished", snapshot["problem"]
    kept = {**snapshot, "installed": installed, "adopted": sensor.adopted}
    (folder / "snapshot.json").write_text(json.dumps(kept))


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The folder of a calibration and what the routine showed at its end; several processes of tests share it."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "calibrated"
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "snapshot.json").exists():
            calibrate(folder)
    return folder, json.loads((folder / "snapshot.json").read_text())
