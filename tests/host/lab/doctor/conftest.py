"""A computer to be examined."""

from pathlib import Path

import pytest

from gellight.lab.doctor import sensor_checks
from gellight.sensor import udev
from tests.helpers.clinic import MEASURED, Clinic


@pytest.fixture
def clinic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Clinic:
    monkeypatch.setattr(sensor_checks, "measure_shutter", lambda camera, groups, timing: MEASURED)  # no rolling shutter
    udev.install(folder=tmp_path, run=lambda command: None)
    return Clinic(tmp_path / "computer")
