"""The wizard in a real browser at the sizes of phones, tablets and desks: nothing cut, nothing over another."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from gellight.daemon.needs import Need
from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import wait_until
from tests.helpers.scripted_calibration import Scripted, pressing, snapshot, stored
from tests.helpers.windows import SIZES, Resize, window, wrong

pytestmark = pytest.mark.browser

VERDICT = {"passed": True, "depth_um": 10.5, "normal_deg": 1.88, "text": "Passed. " + "6 fresh presses. " * 5}
NEEDS = (
    Need(name="ball and cylinder", state="ready", text="the virtual hand has them"),
    Need(name="disk", state="missing", text="12 MB are free in /a/long/path/" + "x" * 60 + ": make room"),
    Need(name="gel", state="yours", text="clean, nothing on it, warm for a quarter of an hour"),
)
LEARNING = snapshot(
    "fit",
    progress={"done": 3, "wanted": 16, "unit": "epochs", "loss": 0.03},
    figures={"fit": {"losses": [0.2, 0.1, 0.03]}},
)
STATES: dict[str, dict[str, Any] | None] = {
    "before": None,
    "pressing": pressing(problem="the contact at (12, 40) px leaves the picture: press elsewhere"),
    "learning": LEARNING,
    "finished": snapshot("finished", verdict=VERDICT, actions=[], pictures=["live", "verify"]),
}


@pytest.fixture
def calibration() -> Scripted:
    calibration = Scripted()
    calibration.needs = NEEDS
    calibration.simulated = calibration.interrupted = True
    calibration.bundles = [stored("a" * 16, created="2026-11-01T10:00:00+00:00", report=True)]
    return calibration


@pytest.fixture
def opened(browser: Browser, server: DashboardServer) -> Iterator[tuple[Page, Resize]]:
    url = f"{server.base}calibrate.html?token={server.token}"
    with window(browser, url, "() => wizard.shown > 1") as page_and_size:
        yield page_and_size


def states(calibration: Scripted, page: Page) -> Iterator[str]:
    """Bring the wizard into one state after the other; yield the names."""
    for name, calibration.routine in STATES.items():
        step = calibration.routine["step"] if calibration.routine else ""
        page.wait_for_function("step => document.body.dataset.step === step", arg=step)
        page.wait_for_timeout(400)
        yield name


def test_nothing_is_cut_and_nothing_overlaps(calibration: Scripted, opened: tuple[Page, Resize]) -> None:
    page, resize = opened
    for name in states(calibration, page):
        for size, (width, height, zoom) in SIZES.items():
            resize(width, height, zoom)
            assert wrong(page, "overlaps", "cut", "beyond") == {}, (name, size)
            guide = page.get_by_test_id("instruction").bounding_box()
            assert guide["y"] + guide["height"] <= height / zoom, "what is to be done needs no scrolling"


def test_text_can_be_read_and_controls_have_edges(calibration: Scripted, opened: tuple[Page, Resize]) -> None:
    """WCAG 2.2 AA: text 4.5 to 1 (1.4.3), edges of controls 3 to 1 (1.4.11); and no text under 12 px."""
    page, resize = opened
    resize(1280, 800)
    for name in states(calibration, page):
        for scheme in ("dark", "light"):
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            assert wrong(page, "weakText", "weakEdges", "smallText") == {}, (name, scheme)


def test_everything_is_reached_with_the_keyboard_and_seen_there(
    calibration: Scripted, opened: tuple[Page, Resize]
) -> None:
    page, resize = opened
    resize(1280, 800)
    reached = []
    for _ in range(14):
        page.keyboard.press("Tab")
        reached.append(page.evaluate("document.activeElement.dataset.testid"))
        assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none", reached[-1]
        if reached[-1] == "action-begin":
            break
    assert reached[:2] == ["back", "which"]
    assert {"ball", "cylinder", "pins", "presses", "hand", "anew", "action-begin"} <= set(reached)
    page.keyboard.press("Enter")
    wait_until(page, lambda: bool(calibration.asked))
    assert [what for what, *_ in calibration.asked] == ["begin"]
