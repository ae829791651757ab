"""Make dashboard.png, the picture of the page in the README: an object is pressed, a line is measured.

    .venv/bin/python docs/pictures/dashboard.py

It needs Playwright and Chromium.
"""

import shutil
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from gellight.base.settings import load_settings
from gellight.daemon.assembly import open_session
from gellight.dashboard.server import DashboardServer

SENSOR = "sim://?object=BALL&depth=1.2&x=3&y=-2"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ("--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
PATIENCE_MS = 300_000
WINDOW = {"width": 1440, "height": 900}
LINE = ((0.26, 0.53), (0.90, 0.33))
"""ends of the measured line, as parts of the picture"""


def main() -> None:
    """Serve the sensor, open the page, press, measure, and write the picture beside this file."""
    browser_path = next(filter(None, map(shutil.which, BROWSERS)), None)
    settings = load_settings({"sensor.url": SENSOR})
    with open_session(settings) as daemon, DashboardServer(daemon, port=0) as server, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=FLAGS)
        page = browser.new_page(viewport=WINDOW, color_scheme="dark")  # type: ignore[arg-type]
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{server.url}#detail=1")
        page.wait_for_function("() => gellight.drawn > 0 && gellight.indentation_mm > 0.1")
        measure(page)
        page.wait_for_function("() => gellight.drawn > 12")
        live = False
        while not live:  # a busy computer may fall behind while the picture is taken
            page.wait_for_function("() => gellight.state === 'live'")
            page.screenshot(path=Path(__file__).with_suffix(".png"))
            live = page.evaluate("gellight.state") == "live"
        browser.close()


def measure(page: Page) -> None:
    """Draw the line, and leave the pointer on it."""
    page.get_by_test_id("measure").click()
    box = page.get_by_test_id("depth").bounding_box()
    assert box is not None
    start, end = ((box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in LINE)
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*end)
    page.mouse.up()
    page.mouse.move(box["x"] + 0.58 * box["width"], box["y"] + 0.43 * box["height"])


if __name__ == "__main__":
    main()
