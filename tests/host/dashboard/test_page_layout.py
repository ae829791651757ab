"""The live page in a real browser at the sizes of phones, tablets and desks: nothing cut, nothing over another."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource, two_bumps
from tests.helpers.windows import SIZES, OpenAt, windows, wrong

pytestmark = pytest.mark.browser

COLUMNS = {
    "phone": 1, "tablet": 2, "tablet on its side": 2, "laptop": 3, "laptop at 125 %": 2, "laptop at 150 %": 2,
    "desk": 3, "desk at 125 %": 3, "desk at 150 %": 3,
}  # fmt: skip
TROUBLE = "/dev/video0 delivers nothing: " + "check the cable " * 5
DRIFT = {"kind": "drift", "severity": "notice", "text": "the light has changed " * 5, "figures": {}}


@pytest.fixture
def troubled(source: FormulaSource) -> FormulaSource:
    """A sensor with long names, and everything wrong that has a place on the page."""
    source.error = TROUBLE
    source.figures |= {
        "sensor": "sim://?" + "object=BALL&" * 10,
        "calibration": {"sensor": "a sensor with a long name", "identity": "9cb18a19860f7702", "verified": None},
        "watch": {"state": "at rest", "findings": [DRIFT]},
        "stage_ms": dict.fromkeys(("difference", "mask", "gradient", "depth", "normals", "contact"), 2.0),
    }
    return source


@pytest.fixture
def window(browser: Browser, server: DashboardServer) -> Iterator[OpenAt]:
    drawn = "() => gellight.drawn > 0 && document.getElementById('contacts').rows.length === 2"
    with windows(browser, server.url, drawn) as open_at:
        yield open_at


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("state", ["well", "troubled"])
def test_nothing_is_cut_and_nothing_overlaps(
    request: pytest.FixtureRequest, source: FormulaSource, window: OpenAt, size: str, state: str
) -> None:
    if state == "troubled":
        request.getfixturevalue("troubled")
    source.put(two_bumps(truth_factor=1.02))
    page = window(*SIZES[size])
    page.get_by_test_id("diagnostics").locator("summary").click()
    page.get_by_test_id("banner-error").wait_for(state="visible" if source.error else "detached")
    draw_a_line(page)
    assert wrong(page, "overlaps", "cut", "beyond") == {}
    assert columns(page) == COLUMNS[size]


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
    """How many panels begin at different places from left to right; the contact's column beside the pictures counts."""
    lefts = page.evaluate("""() => ["depth", "raw", "difference", "contact", "press"].map((name) =>
        Math.round(document.querySelector(`.panel.${name}`).getBoundingClientRect().left))""")
    return len(set(lefts))


@pytest.mark.parametrize("size", ["phone", "laptop", "desk"])
def test_every_picture_keeps_its_proportions_and_is_no_stamp(source: FormulaSource, window: OpenAt, size: str) -> None:
    source.put(two_bumps(truth_factor=1.02))
    page = window(*SIZES[size])
    for name in ("depth", "truth", "image", "difference", "normal"):
        box = page.get_by_test_id(name).bounding_box()
        assert box["width"] / box["height"] == pytest.approx(4 / 3, rel=0.02)
        assert box["width"] >= 140


def test_a_laptop_sees_the_surface_the_depth_and_the_contact_without_scrolling(
    source: FormulaSource, window: OpenAt
) -> None:
    source.put(two_bumps(truth_factor=1.02))
    page = window(*SIZES["laptop"])
    for name in ("surface", "depth", "truth", "indentation", "contacts"):
        box = page.get_by_test_id(name).bounding_box()
        assert box["y"] + box["height"] <= 625


def test_a_page_without_a_truth_gives_its_place_to_the_depth(source: FormulaSource, window: OpenAt) -> None:
    source.put(two_bumps())
    page = window(*SIZES["desk"])
    assert not page.get_by_test_id("truth-panel").is_visible()
    depth, camera = (page.locator(f".panel.{name}").bounding_box() for name in ("depth", "raw"))
    assert depth["width"] > 1.9 * camera["width"]


@pytest.mark.parametrize("scheme", ["dark", "light"])
@pytest.mark.parametrize("state", ["live", "stale", "lost", "paused", "troubled"])
def test_text_can_be_read_and_controls_have_edges(
    request: pytest.FixtureRequest,
    source: FormulaSource,
    server: DashboardServer,
    window: OpenAt,
    scheme: str,
    state: str,
) -> None:
    """WCAG 2.2 AA: text 4.5 to 1 (1.4.3), edges of controls 3 to 1 (1.4.11); and no text under 12 px."""
    if state == "troubled":
        request.getfixturevalue("troubled")
    source.put(two_bumps(truth_factor=1.02))
    page = window(1280, 800, 1.0, scheme)
    page.get_by_test_id("diagnostics").locator("summary").click()
    if state == "lost":
        server.stop()
    if state == "paused":
        page.get_by_test_id("pause").click()
    if state == "live":
        source.put(two_bumps(truth_factor=1.02))
    if state != "troubled":
        page.wait_for_function("state => gellight.state === state", arg=state)
    assert wrong(page, "weakText", "weakEdges", "smallText") == {}
    ground = page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
    assert (sum(map(int, ground[4:-1].split(","))) < 200) == (scheme == "dark")
