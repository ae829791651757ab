"""Windows of the sizes of phones, tablets and desks, and what can be measured in them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page

from tests.helpers.browsing import PATIENCE_MS, paint

MEASURES = (Path(__file__).parent / "page_measures.js").read_text()
SIZES = {
    "phone": (390, 844, 1.0),
    "tablet": (768, 1024, 1.0),
    "tablet on its side": (1024, 768, 1.0),
    "laptop": (1366, 625, 1.0),
    "laptop at 125 %": (1366, 625, 1.25),
    "laptop at 150 %": (1366, 625, 1.5),
    "desk": (1920, 1080, 1.0),
    "desk at 125 %": (1920, 1080, 1.25),
    "desk at 150 %": (1920, 1080, 1.5),
}
"""width and height of the window, and the zoom, which makes the window smaller in CSS pixels"""
Resize = Callable[[int, int, float], None]


@contextmanager
def window(browser: Browser, url: str, ready: str) -> Iterator[tuple[Page, Resize]]:
    """Open `url` and wait until the script `ready` is true; give the page, and what makes its window another."""
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(url)
    page.wait_for_function(ready)
    page.evaluate(MEASURES)
    metrics = context.new_cdp_session(page)

    def resize(width: int, height: int, zoom: float = 1.0) -> None:
        size = {"width": round(width / zoom), "height": round(height / zoom), "deviceScaleFactor": zoom}
        metrics.send("Emulation.setDeviceMetricsOverride", {**size, "mobile": False})
        page.wait_for_function(
            "([width, zoom]) => innerWidth === width && devicePixelRatio === zoom", arg=[size["width"], zoom]
        )
        paint(page)

    yield page, resize
    context.close()


def wrong(page: Page, *kinds: str) -> dict[str, list[object]]:
    """Return what the measures of `kinds` find, without those that find nothing."""
    return {kind: found for kind in kinds if (found := page.evaluate(f"measures.{kind}()"))}
