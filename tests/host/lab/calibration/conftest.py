"""One calibration from end to end, kept on disk for all that begins with one."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.lab.calibration.routine import Routine
from gellight.lab.simulator.virtual_hand import VirtualHand
from tests.helpers.calibration_routine import LIT, SOON, camera, finished, options
from tests.helpers.made_once import made_once


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
            sensor,
            options(folder, training=SOON),
            folder / "state",
            hand=hand,
            install=lambda bundle: installed.append(bundle.source),
        )
        snapshot = finished(routine)
    assert snapshot["step"] == "finished", snapshot["problem"]
    kept = {**snapshot, "installed": installed, "adopted": sensor.adopted}
    (folder / "snapshot.json").write_text(json.dumps(kept))


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The folder of a calibration and what the routine showed at its end; several processes of tests share it."""
    folder = made_once(tmp_path_factory, "calibrated", calibrate)
    return folder, json.loads((folder / "snapshot.json").read_text())
