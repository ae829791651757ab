"""The server of a calibration that follows a script; pages of other kinds have servers of their own."""

from collections.abc import Iterator

import pytest

from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.scripted_calibration import Scripted


@pytest.fixture
def calibration() -> Scripted:
    return Scripted()


@pytest.fixture
def server(source: FormulaSource, calibration: Scripted) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0, calibration=calibration) as server:
        yield server
