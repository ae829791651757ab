"""A real browser for the tests: Chromium without a screen, with and without 3D."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, Page, expect

from gellight.dashboard.server import DashboardServer
from gellight.frames.frames import TactileFrame
from tests.helpers.dashboard_source import FormulaSource, bump, moving_bump

SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
NO_GL = ["--disable-3d-apis"]
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
PATIENCE_MS = 60_000
"""for a loaded machine; nothing is judged by its speed"""
expect.set_options(timeout=PATIENCE_MS)  # Playwright's own are 5 s, which a busy machine needs to open the page
SIZES = ({"width": 1280, "height": 800}, {"width": 1920, "height": 1080})

Open = Callable[..., Page]


@contextmanager
def opening(browser: Browser, server: DashboardServer, place: str = "") -> Iterator[Open]:
    """Open the page; at the end nothing may have gone wrong in it."""
    complaints: list[str] = []
    context = browser.new_context(viewport=SIZES[0])
    context.set_default_timeout(PATIENCE_MS)

    def open_page() -> Page:
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: message.type == "error" and complaints.append(message.text))
        page.goto(f"{server.base}{place}?token={server.token}")
        return page

    yield open_page
    context.close()
    # A lost server, by its socket or by a request that was on its way; what is refused, and told.
    known = ("WebSocket connection", "net::ERR_CONNECTION", "net::ERR_EMPTY_RESPONSE", "status of 409", "status of 503")
    unknown = [text for text in complaints if not any(words in text for words in known)]
    assert not unknown, unknown


@contextmanager
def playing(source: FormulaSource, *frames: TactileFrame) -> Iterator[None]:
    stop = threading.Event()
    thread = threading.Thread(target=source.play, args=(list(frames) or moving_bump(20), 10, stop))
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def becomes_live(page: Page, source: FormulaSource, *frames: TactileFrame) -> None:
    """Wait until the page calls itself live, while frames come: one alone is old before a busy machine looks."""
    with playing(source, *frames):
        expect(page.get_by_test_id("state")).to_have_text("live")


def draw(page: Page, source: FormulaSource, depth_mm: float, x_mm: float = 0.0, y_mm: float = 0.0) -> None:
    """Put a bump before the sensor and wait until the page has drawn it, its surface too."""
    sequence = source.put(bump(depth_mm, x_mm, y_mm))
    page.wait_for_function("sequence => gellight.sequence === sequence && gellight.surface !== 'waiting'", arg=sequence)


def paint(page: Page) -> None:
    """Wait until the page has painted what has changed so far: the second animation frame follows the first's paint."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def wait_until(page: Page, true: Callable[[], bool]) -> None:
    """Wait for what the page itself cannot be asked; fails after `PATIENCE_MS`."""
    for _ in range(PATIENCE_MS // 50):
        if true():
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"did not come true within {PATIENCE_MS / 1000:.0f} s")
