"""A computer to be examined."""

from pathlib import Path

import pytest

from gellight.sensor import udev
from tests.helpers.clinic import Clinic


@pytest.fixture
def clinic(tmp_path: Path) -> Clinic:
    udev.install(folder=tmp_path, run=lambda command: None)
    return Clinic(tmp_path / "computer")
