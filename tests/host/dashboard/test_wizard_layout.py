"""The wizard in a real browser at the sizes of phones, tablets and desks: nothing cut, nothing over another."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser

from gellight.daemon.needs import Need
from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.scripted_calibration import Scripted, pressing, snapshot, stored
from tests.helpers.windows import SIZES, OpenAt, windows, wrong

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
def server(source: FormulaSource, calibration: Scripted) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0, calibration=calibration) as server:
        yield server


@pytest.fixture
def window(browser: Browser, server: DashboardServer) -> Iterator[OpenAt]:
    with windows(browser, f"{server.base}calibrate.html?token={server.token}", "() => wizard.shown > 1") as open_at:
        yield open_at


@pytest.mark.parametrize("size", SIZES)
def test_nothing_is_cut_and_nothing_overlaps(calibration: Scripted, window: OpenAt, size: str) -> None:
    page = window(*SIZES[size])
    for name, routine in STATES.items():
        calibration.routine = routine
        page.wait_for_function("step => document.body.dataset.step === step", arg=routine["step"] if routine else "")
        page.wait_for_timeout(400)
        assert wrong(page, "overlaps", "cut", "beyond") == {}, name
        guide = page.get_by_test_id("instruction").bounding_box()
        assert guide["y"] + guide["height"] <= SIZES[size][1] / SIZES[size][2], "what is to be done needs no scrolling"


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_text_can_be_read_and_controls_have_edges(calibration: Scripted, window: OpenAt, scheme: str) -> None:
    """WCAG 2.2 AA: text 4.5 to 1 (1.4.3), edges of controls 3 to 1 (1.4.11); and no text under 12 px."""
    page = window(1280, 800, 1.0, scheme)
    for name, routine in STATES.items():
        calibration.routine = routine
        page.wait_for_function("step => document.body.dataset.step === step", arg=routine["step"] if routine else "")
        page.wait_for_timeout(400)
        assert wrong(page, "weakText", "weakEdges", "smallText") == {}, name


def test_everything_is_reached_with_the_keyboard_and_seen_there(calibration: Scripted, window: OpenAt) -> None:
    page = window(1280, 800)
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
    page.wait_for_timeout(300)
    assert [what for what, *_ in calibration.asked] == ["begin"]
