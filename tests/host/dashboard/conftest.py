"""The server of a calibration that follows a script, and pages that it serves; some tests have servers of their own."""

from collections.abc import Callable, Iterator
from functools import partial

import pytest
from playwright.sync_api import Page as BrowserPage

from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import Open, draw
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.page_client import Page, pages
from tests.helpers.scripted_calibration import Scripted


@pytest.fixture(scope="session", autouse=True)
def own_runtime_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The token of the pages is kept there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
        yield


@pytest.fixture
def calibration() -> Scripted:
    return Scripted()


@pytest.fixture
def server(source: FormulaSource, calibration: Scripted) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0, calibration=calibration) as server:
        yield server


@pytest.fixture
def open_page(server: DashboardServer) -> Iterator[Callable[[], Page]]:
    with pages() as connect:
        yield partial(connect, server.base)


@pytest.fixture
def client(open_page: Callable[[], Page]) -> Page:
    return open_page()


@pytest.fixture
def page(opened: Open, source: FormulaSource) -> BrowserPage:
    """The page in a browser without 3D, which shows a bump 0.5 mm deep."""
    page = opened()
    draw(page, source, 0.5)
    return page
