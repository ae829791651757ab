"""The live page for fingers and for eyes of every kind."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page, expect

from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import PATIENCE_MS, Open, paint
from tests.helpers.dashboard_source import FormulaSource, two_bumps

pytestmark = pytest.mark.browser

PHONE = {"width": 390, "height": 844}
LEAST_PX = 24  # of a target, WCAG 2.2 AA (2.5.8)
DEFECTS = {
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
}
"""on linear RGB, complete: Machado, Oliveira, Fernandes 2009"""
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


@pytest.fixture
def phone(browser: Browser, server: DashboardServer, source: FormulaSource) -> Iterator[Page]:
    source.put(two_bumps(truth_factor=1.02))
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True)  # type: ignore[arg-type]
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(server.url)
    page.wait_for_function("() => gellight.drawn > 0 && !document.getElementById('press').hidden")
    yield page
    context.close()


def test_a_finger_that_is_dragged_presses_and_does_not_scroll(phone: Page, source: FormulaSource) -> None:
    box = phone.get_by_test_id("depth").bounding_box()
    finger = phone.context.new_cdp_session(phone)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] * 0.8
    finger.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for up in range(0, 160, 20):
        finger.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y - up}]})
        phone.wait_for_timeout(50)
    finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    expect(phone.get_by_test_id("stage-now")).to_contain_text("nothing pressed")
    *presses, released = source.stage.calls
    first, last = presses[0], presses[-1]
    assert released is None
    assert first[3] - last[3] > 5.0, "mm upwards"
    assert phone.evaluate("scrollY") == 0


def test_a_phone_has_depth_indentation_and_press_on_its_first_screen_and_targets_for_fingers(phone: Page) -> None:
    for name in ("depth", "indentation", "press-here", "release"):
        box = phone.get_by_test_id(name).bounding_box()
        assert box["y"] + box["height"] <= PHONE["height"], name
    small = phone.evaluate(
        """least => [...document.querySelectorAll("button, select, input, a, summary")]
            .filter((e) => e.checkVisibility())
            .map((e) => [e.id || e.textContent, (e.closest("label") ?? e).getBoundingClientRect()])
            .filter(([, { width, height }]) => width > 0 && Math.min(width, height) < least).map(([name]) => name)""",
        LEAST_PX,
    )
    assert small == []


def test_a_laptop_shows_all_its_panels_without_scrolling_and_a_surface_in_2d_says_why(page: Page) -> None:
    page.set_viewport_size({"width": 1366, "height": 768})
    paint(page)
    assert page.evaluate("document.documentElement.scrollHeight") <= 768
    expect(page.get_by_test_id("level")).to_have_text("2D relief: this browser offers no WebGL 2")
    expect(page.get_by_test_id("detail")).to_be_disabled()


def test_escape_closes_one_thing_at_a_time(page: Page, source: FormulaSource) -> None:
    page.get_by_test_id("measure").click()
    box = page.get_by_test_id("depth").bounding_box()
    page.mouse.move(box["x"] + 20, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + 120, box["y"] + 90)
    page.mouse.up()
    page.keyboard.press("?")
    left = []
    for _ in range(4):
        left.append(
            page.evaluate("""[!!document.querySelector(":popover-open"), !!gellight.section,
            document.getElementById("measure").getAttribute("aria-pressed") === "true"]""")
        )
        page.keyboard.press("Escape")
    assert left == [[True, True, True], [False, True, True], [False, False, True], [False, False, False]]


def lightness_a_b(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIELAB of linear RGB."""
    scaled = rgb.clip(0) @ TO_XYZ.T / TO_XYZ.sum(axis=1)
    x, y, z = np.where(scaled > 0.008856, np.cbrt(scaled), 7.787 * scaled + 16 / 116).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


def test_every_eye_tells_the_depths_of_a_map_apart(page: Page, source: FormulaSource) -> None:
    """For each defect: deeper is brighter, every tenth of the scale is another colour, and none is that beyond it."""
    for name in ("ocean", "viridis", "cividis", "grey"):
        page.get_by_test_id("map").select_option(name)
        colours = page.evaluate("""async () => {
            const { depthColour } = await import("./colour.js");
            return Array.from({ length: 12 }, (_, i) => depthColour(i / 10));
        }""")
        grey = np.array(colours) / 255
        linear = np.where(grey <= 0.04045, grey / 12.92, ((grey + 0.055) / 1.055) ** 2.4)
        for defect in (np.eye(3), *map(np.array, DEFECTS.values())):
            seen = lightness_a_b(linear @ defect.T)
            steps, beyond = seen[:11], seen[11]
            assert (np.diff(steps[:, 0]) > 2).all(), name
            assert (np.linalg.norm(np.diff(steps, axis=0), axis=1) > 5).all(), name
            assert (np.linalg.norm(steps - beyond, axis=1) > 30).all(), name


def test_the_chosen_map_colours_depth_truth_and_legend(opened: Open, source: FormulaSource) -> None:
    page = opened()
    source.put(two_bumps(truth_factor=1.0))
    page.wait_for_function("() => gellight.drawn > 0")
    page.get_by_test_id("map").select_option("grey")
    greys = page.evaluate("""() => ["truth", "bar"].map((id) => {
        const canvas = document.getElementById(id);
        const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        return data.every((value, i) => i % 4 === 3 || value === data[i - (i % 4)]);
    })""")
    assert greys == [True, True]
