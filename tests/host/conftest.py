"""Browsers, started once a module: Playwright keeps an event loop running in the thread as long as it is there.

And the bundle that comes with GelLight, and a computer into which sensors are plugged.
"""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import FLAGS, NO_GL, SOFTWARE_GL, Open, opening
from tests.helpers.dashboard_source import FormulaSource, RecordingStage
from tests.helpers.sensor_bench import Bench


@pytest.fixture(scope="module")
def chromium() -> Iterator[Callable[[list[str]], Browser]]:
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        pytest.skip("needs Chromium: sudo apt-get install chromium")
    with sync_playwright() as playwright:
        yield lambda flags: playwright.chromium.launch(executable_path=path, args=FLAGS + flags)


@pytest.fixture(scope="module")
def browser(chromium: Callable[[list[str]], Browser]) -> Iterator[Browser]:
    """A browser without 3D, as quick as it gets."""
    with chromium(NO_GL) as browser:
        yield browser


@pytest.fixture(scope="module")
def browser_3d(chromium: Callable[[list[str]], Browser]) -> Iterator[Browser]:
    """A browser that draws 3D without a graphics card."""
    with chromium(SOFTWARE_GL) as browser:
        yield browser


@pytest.fixture(scope="session")
def synthetic() -> Bundle:
    return load_bundle("synthetic")


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path / "computer")


@pytest.fixture
def source() -> FormulaSource:
    return FormulaSource(stage=RecordingStage())


@pytest.fixture
def server(source: FormulaSource) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0) as server:
        yield server


@pytest.fixture
def opened(browser: Browser, server: DashboardServer) -> Iterator[Open]:
    with opening(browser, server) as open_page:
        yield open_page


@pytest.fixture
def opened_3d(browser_3d: Browser, server: DashboardServer) -> Iterator[Open]:
    with opening(browser_3d, server) as open_page:
        yield open_page
