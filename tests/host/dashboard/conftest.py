"""A dashboard of formulas, served."""

from collections.abc import Iterator

import pytest

from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource, RecordingStage


@pytest.fixture
def source() -> FormulaSource:
    return FormulaSource(stage=RecordingStage())


@pytest.fixture
def server(source: FormulaSource) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0) as server:
        yield server
