"""The pages in a real browser at the sizes of phones, tablets and desks: nothing cut, nothing over another."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from gellight.daemon.needs import Need
from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import becomes_live, wait_until
from tests.helpers.dashboard_source import FormulaSource, two_bumps
from tests.helpers.scripted_calibration import Scripted, pressing, snapshot, stored
from tests.helpers.windows import SIZES, Resize, window, wrong

pytestmark = pytest.mark.browser

COLUMNS = {
    "phone": 1, "tablet": 2, "tablet on its side": 2, "laptop": 3, "laptop at 125 %": 2, "laptop at 150 %": 2,
    "desk": 3, "desk at 125 %": 3, "desk at 150 %": 3,
}  # fmt: skip
DRIFT = {"kind": "drift", "severity": "notice", "text": "the light has changed " * 5, "figures": {}}


def trouble(source: FormulaSource) -> None:
    """Give the sensor long names, and make everything wrong that has a place on the page."""
    source.error = "/dev/video0 delivers nothing: " + "check the cable " * 5
    source.figures |= {
        "sensor": "sim://?" + "object=BALL&" * 10,
        "calibration": {"sensor": "a sensor with a long name", "identity": "9cb18a19860f7702", "verified": None},
        "watch": {"state": "at rest", "findings": [DRIFT]},
        "stage_ms": dict.fromkeys(("difference", "mask", "gradient", "depth", "normals", "contact"), 2.0),
    }


@pytest.fixture
def opened(browser: Browser, server: DashboardServer, source: FormulaSource) -> Iterator[tuple[Page, Resize]]:
    source.put(two_bumps(truth_factor=1.02))
    drawn = "() => gellight.drawn > 0 && document.getElementById('contacts').rows.length === 2"
    with window(browser, server.url, drawn) as page_and_size:
        page_and_size[0].get_by_test_id("diagnostics").locator("summary").click()
        yield page_and_size


def test_nothing_is_cut_and_nothing_overlaps(opened: tuple[Page, Resize], source: FormulaSource) -> None:
    page, resize = opened
    draw_a_line(page)
    for state in ("well", "troubled"):
        if state == "troubled":
            trouble(source)
            page.get_by_test_id("banner-error").wait_for()
        for name, size in SIZES.items():
            resize(*size)
            assert wrong(page, "overlaps", "cut", "beyond") == {}, (state, name)
            assert columns(page) == COLUMNS[name], (state, name)


def draw_a_line(page: Page) -> None:
    page.get_by_test_id("measure").click()
    picture = page.get_by_test_id("depth")
    picture.scroll_into_view_if_needed()
    box = picture.bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.3 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 0.7 * box["height"])
    page.mouse.up()
    page.wait_for_function("() => gellight.section")


def columns(page: Page) -> int:
    """How many panels begin at different places from left to right, beside the large depth; the contact's counts."""
    lefts = page.evaluate("""() => ["surface", "raw", "difference", "contact", "press"].map((name) =>
        Math.round(document.querySelector(`.panel.${name}`).getBoundingClientRect().left))""")
    return len(set(lefts))


def test_the_depth_is_the_largest_picture(opened: tuple[Page, Resize]) -> None:
    page, resize = opened
    for name, size in SIZES.items():
        resize(*size)
        depth, *others = page.evaluate("""() => ["depth", "truth", "image", "difference", "normal", "surface"]
            .map((id) => document.getElementById(id).getBoundingClientRect())
            .map(({ width, height }) => width * height)""")
        assert depth >= max(others) * (1.1 if columns(page) > 1 else 1), (name, depth, others)


def test_every_picture_has_its_place(opened: tuple[Page, Resize], source: FormulaSource) -> None:
    page, resize = opened
    page.get_by_test_id("diagnostics").locator("summary").click()
    for size in ("phone", "laptop", "desk"):
        resize(*SIZES[size])
        for name in ("depth", "truth", "image", "difference", "normal"):
            box = page.get_by_test_id(name).bounding_box()
            assert box["width"] / box["height"] == pytest.approx(4 / 3, rel=0.02), (size, name)
            assert box["width"] >= 140, (size, name)
        if size == "laptop":
            for name in ("surface", "depth", "truth", "indentation", "contacts"):
                box = page.get_by_test_id(name).bounding_box()
                assert box["y"] + box["height"] <= 625, f"{name} is seen without scrolling"
    source.put(two_bumps())
    expect(page.get_by_test_id("truth-panel")).to_be_hidden()
    surface, camera = (page.locator(f".panel.{name}").bounding_box() for name in ("surface", "raw"))
    assert surface["width"] > 1.9 * camera["width"], "without a truth its place is the surface's"


def test_text_can_be_read_and_controls_have_edges(
    opened: tuple[Page, Resize], source: FormulaSource, server: DashboardServer
) -> None:
    """WCAG 2.2 AA: text 4.5 to 1 (1.4.3), edges of controls 3 to 1 (1.4.11); and no text under 12 px."""
    page, resize = opened
    resize(1280, 800)

    def judge(state: str) -> None:
        for scheme in ("dark", "light"):
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            if state == "live":
                becomes_live(page, source, two_bumps(truth_factor=1.02))
            elif state != "troubled":
                page.wait_for_function("state => gellight.state === state", arg=state)
            assert wrong(page, "weakText", "weakEdges", "smallText") == {}, (state, scheme)
            ground = page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
            assert (sum(map(int, ground[4:-1].split(","))) < 200) == (scheme == "dark")

    judge("live")
    judge("stale")
    page.get_by_test_id("pause").click()
    judge("paused")
    page.get_by_test_id("pause").click()
    trouble(source)
    page.get_by_test_id("banner-error").wait_for()
    judge("troubled")
    server.stop()
    judge("lost")


# ---- the wizard ----


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
def wizard(browser: Browser, server: DashboardServer) -> Iterator[tuple[Page, Resize]]:
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


def test_nothing_of_the_wizard_is_cut_and_nothing_overlaps(calibration: Scripted, wizard: tuple[Page, Resize]) -> None:
    page, resize = wizard
    for name in states(calibration, page):
        for size, (width, height, zoom) in SIZES.items():
            resize(width, height, zoom)
            assert wrong(page, "overlaps", "cut", "beyond") == {}, (name, size)
            guide = page.get_by_test_id("instruction").bounding_box()
            assert guide["y"] + guide["height"] <= height / zoom, "what is to be done needs no scrolling"


def test_text_of_the_wizard_can_be_read_and_its_controls_have_edges(
    calibration: Scripted, wizard: tuple[Page, Resize]
) -> None:
    page, resize = wizard
    resize(1280, 800)
    for name in states(calibration, page):
        for scheme in ("dark", "light"):
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            assert wrong(page, "weakText", "weakEdges", "smallText") == {}, (name, scheme)


def test_everything_is_reached_with_the_keyboard_and_seen_there(
    calibration: Scripted, wizard: tuple[Page, Resize]
) -> None:
    page, resize = wizard
    resize(1280, 800)
    reached = []
    for _ in range(14):
        page.keyboard.press("Tab")
        reached.append(page.evaluate("document.activeElement.dataset.testid"))
        assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none", reached[-1]
        if reached[-1] == "action-begin":
            break
    assert reached[:2] == ["back", "which"]
    assert {"ball", "cylinder", "pixel", "presses", "hand", "anew", "action-begin"} <= set(reached)
    page.keyboard.press("Enter")
    wait_until(page, lambda: bool(calibration.asked))
    assert [what for what, *_ in calibration.asked] == ["begin"]
