"""Browsers, started once a process.

And the bundle that comes with GelLight, and a computer into which sensors are plugged.
"""

import asyncio
import shutil
from asyncio import AbstractEventLoop
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import FLAGS, NO_GL, SOFTWARE_GL, Open, opening
from tests.helpers.dashboard_source import FormulaSource, RecordingStage
from tests.helpers.sensor_bench import Bench


@pytest.fixture(scope="session")
def playwright() -> Iterator[tuple[Callable[..., Browser], AbstractEventLoop]]:
    """What starts Chromium, once for each set of flags, and the event loop that Playwright leaves running."""
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        pytest.skip("needs Chromium: sudo apt-get install chromium")
    with sync_playwright() as playwright:
        loop = asyncio.get_running_loop()
        yield cache(lambda *flags: playwright.chromium.launch(executable_path=path, args=[*FLAGS, *flags])), loop
        asyncio._set_running_loop(loop)


@pytest.fixture
def chromium(playwright: tuple[Callable[..., Browser], AbstractEventLoop]) -> Iterator[Callable[..., Browser]]:
    """The loop counts as running during the tests of a browser alone: others have loops of their own."""
    launched, loop = playwright
    asyncio._set_running_loop(loop)
    yield launched
    asyncio._set_running_loop(None)


@pytest.fixture
def browser(chromium: Callable[..., Browser]) -> Browser:
    """A browser without 3D, as quick as it gets."""
    return chromium(*NO_GL)


@pytest.fixture
def browser_3d(chromium: Callable[..., Browser]) -> Browser:
    """A browser that draws 3D without a graphics card."""
    return chromium(*SOFTWARE_GL)


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
