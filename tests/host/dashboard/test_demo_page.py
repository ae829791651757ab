"""The whole demo in a real browser: press an object, read on the page how deep it went."""

import json

import pytest
from playwright.sync_api import Browser, expect

from gellight.daemon.assembly import open_session
from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import PATIENCE_MS, opening
from tests.helpers.settings import loaded

pytestmark = pytest.mark.browser

WIDTH_PX, HEIGHT_PX, PIXEL_MM = 640, 480, 0.0588


def test_a_visitor_presses_the_ball_and_sees_its_true_depth(browser: Browser) -> None:
    settings = loaded({"sensor.url": "sim://?programme=0"})
    with (
        open_session(settings) as daemon,
        DashboardServer(daemon, port=0) as server,
        opening(browser, server) as open_page,
    ):
        page = open_page()
        expect(page.get_by_test_id("state")).to_have_text("live", timeout=PATIENCE_MS)
        page.get_by_test_id("object-BALL").click()
        page.get_by_test_id("press-depth").fill("1")
        box = page.get_by_test_id("image").bounding_box()
        page.mouse.move(box["x"] + 0.65 * box["width"], box["y"] + 0.4 * box["height"])
        page.mouse.down()
        page.wait_for_function("() => window.gellight.indentation_mm > 0.9", timeout=PATIENCE_MS)
        seen = json.loads(page.evaluate("() => JSON.stringify(window.gellight)"))
        truth = daemon.wait_frame(0, 20).camera_frame.truth
        page.mouse.up()
        page.wait_for_function("() => window.gellight.indentation_mm === 0", timeout=PATIENCE_MS)
    assert seen["indentation_mm"] == pytest.approx(float(truth.depth_mm.max()), rel=0.10)
    assert seen["centroid_mm"] == pytest.approx([0.15 * WIDTH_PX * PIXEL_MM, -0.1 * HEIGHT_PX * PIXEL_MM], abs=0.25), (
        "it is felt where the pointer is"
    )
    assert seen["fps"] > 0
