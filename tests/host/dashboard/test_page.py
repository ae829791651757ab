"""The page in a real browser: what a visitor sees equals what the sensor said."""

from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import Open, draw, paint, wait_until
from tests.helpers.dashboard_source import PIXEL_MM, FormulaSource, bump
from tests.helpers.weighed import HeavyFrames

pytestmark = pytest.mark.browser


def pixel(page: Page, canvas: str, column: int, row: int) -> list[int]:
    found: list[int] = page.evaluate(
        "([id, x, y]) => [...document.getElementById(id).getContext('2d').getImageData(x, y, 1, 1).data]",
        [canvas, column, row],
    )
    return found


def test_the_page_asks_nobody_but_this_machine(
    browser_3d: Browser, server: DashboardServer, source: FormulaSource
) -> None:
    page = browser_3d.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("websocket", lambda websocket: asked.append(websocket.url))
    page.goto(server.url)
    draw(page, source, 1.0)
    page.close()
    own = (server.base, server.base.replace("http:", "ws:"), f"blob:{server.base}")
    assert [url for url in asked if not url.startswith(own)] == []
    assert any(url.endswith("vendor/three-0.185/three.module.min.js") for url in asked)
    assert any(url.startswith("ws:") for url in asked)


def test_the_numbers_are_the_sensors(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.8764, 4.0, -3.0)
    truth = bump(0.8764, 4.0, -3.0).contact
    assert page.evaluate("gellight.indentation_mm") == truth.indentation_mm
    assert page.evaluate("gellight.area_mm2") == truth.area_mm2
    shown = {
        "indentation": f"{truth.indentation_mm:.3f}",
        "area": f"{truth.area_mm2:.1f}",
        "centroid": f"{truth.centroid_mm[0]:.2f}, {truth.centroid_mm[1]:.2f}",
        "fps": "30.0",
        "age-median": "11.2",
        "age-p95": "17.8",
        "dropped": "3",
        "sensor": "formula://bump",
    }
    for name, text in shown.items():
        expect(page.get_by_test_id(name)).to_have_text(text)
    expect(page.get_by_test_id("stages")).to_contain_text("gelnet")


CALIBRATION: dict[str, object] = {"sensor": "S1", "identity": "9cb18a19860f7702", "verified": None}
VERIFIED: dict[str, object] = {"presses": 6, "depth_mm": 0.0031, "normal_deg": 0.243}
WARM = {"chip_c": 41.4, "ring_c": 33.6, "dimmed": 0, "mean_ma": 120}
SHOWN = [
    ({}, "mode", ""),
    ({"calibration": CALIBRATION}, "bundle", "S1 9cb18a, not verified"),
    ({"calibration": CALIBRATION | {"verified": VERIFIED}}, "bundle", "S1 9cb18a, shape ±3 µm, normals ±0.2°"),
    ({"calibration": CALIBRATION | {"verified": VERIFIED | {"true_depth_mm": 0.0123}}}, "bundle",
     "S1 9cb18a, depth ±12 µm, normals ±0.2°"),
    ({"mode": "photometric", "exposures": {"exposures": 4, "moved": False}}, "mode", "photometric, 4 exposures"),
    ({"mode": "photometric", "exposures": {"exposures": 4, "moved": True}}, "mode",
     "photometric, 4 exposures, scene moved"),
    ({"ring": WARM}, "heat", "34 °C, chip 41 °C"),
    ({"ring": WARM | {"chip_c": 66.0, "ring_c": None, "dimmed": 2}}, "heat", "chip 66 °C, dimmed to 1/4"),
    ({"recording": "press.mcap"}, "recording", "recording press.mcap"),
]  # fmt: skip


def test_what_the_sensor_says_of_itself_is_shown(opened: Open, source: FormulaSource) -> None:
    page, plain = opened(), source.figures
    page.get_by_test_id("diagnostics").locator("summary").click()
    draw(page, source, 0.5)
    for hidden in ("force-row", "heat-row", "recording"):
        expect(page.get_by_test_id(hidden)).to_be_hidden()
    for figures, name, text in SHOWN:
        source.figures = plain | figures
        expect(page.get_by_test_id(name)).to_have_text(text)
        if text.endswith("dimmed to 1/4"):
            expect(page.get_by_test_id("heat-row")).to_have_attribute("class", "notice")
    source.figures = plain
    expect(page.get_by_test_id("recording")).to_be_hidden()
    source.put(replace(bump(0.5, 0.0, 0.0), measures=HeavyFrames()))
    expect(page.get_by_test_id("force-row")).to_have_text("force1.25 ±0.10 N")
    expect(page.get_by_test_id("force-row")).to_have_attribute("title", "heavier than calibrated")


def test_what_the_sensor_says_is_text_never_markup(opened: Open, source: FormulaSource) -> None:
    source.figures["sensor"] = "<img src=x onerror=alert(1)>"
    source.error = "<b>cable</b>"
    page = opened()
    expect(page.get_by_test_id("sensor")).to_have_text("<img src=x onerror=alert(1)>")
    expect(page.get_by_test_id("banner-error").locator("p")).to_have_text("<b>cable</b>")


def test_what_the_watch_has_found_is_told_above_the_pictures(opened: Open, source: FormulaSource) -> None:
    page = opened()
    expect(page.get_by_test_id("sensor")).to_have_text("formula://bump")
    expect(page.get_by_test_id("watch")).to_be_hidden()
    dead = {"kind": "led_dead", "severity": "fault", "text": "LED 3 is <b>dark</b>", "figures": {"led": 3}}
    drift = {"kind": "drift", "severity": "notice", "text": "the light is 96 %", "figures": {}}
    source.figures["watch"] = {"state": "at rest", "findings": [dead, drift]}
    expect(page.get_by_test_id("findings").locator("li")).to_have_text(["LED 3 is <b>dark</b>", "the light is 96 %"])
    expect(page.get_by_test_id("findings").locator("li").first).to_have_class("fault")
    page.get_by_test_id("hide-watch").click()
    expect(page.get_by_test_id("watch")).to_be_hidden()
    source.figures["watch"] = {"state": "at rest", "findings": [{**dead, "figures": {"led": 4}}]}
    expect(page.get_by_test_id("watch")).to_be_visible()


def test_the_colour_of_a_depth_depends_on_the_scale_alone_which_says_its_ends(
    page: Page, source: FormulaSource
) -> None:
    alone = pixel(page, "depth", 160, 120)
    rest = pixel(page, "depth", 10, 10)
    draw(page, source, 1.4)
    deeper = pixel(page, "depth", 160, 120)
    assert pixel(page, "depth", 10, 10) == rest
    assert len({tuple(alone), tuple(deeper), tuple(rest)}) == 3
    draw(page, source, 0.5, 5.0, 0.0)
    assert pixel(page, "depth", 160 + round(5.0 / PIXEL_MM / 2), 120) == pytest.approx(alone, abs=2)
    draw(page, source, 0.5)
    expect(page.get_by_test_id("ticks").locator("li")).to_have_text(["0 µm", "800 µm", "1600 µm"])
    page.get_by_test_id("scale").select_option("200")
    expect(page.get_by_test_id("ticks").locator("li").last).to_have_text("200 µm")
    above = pixel(page, "depth", 160, 120)
    assert above != alone
    assert above[:3] == [200, 0, 255], "what is above the scale is told apart"


def test_difference_and_normals_are_drawn_by_their_definition(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 1.2)
    frame = bump(1.2, 0.0, 0.0)
    column, row = 195, 110
    difference = frame.difference[2 * row : 2 * row + 2, 2 * column : 2 * column + 2].mean(axis=(0, 1))
    normal = frame.normal_map[2 * row : 2 * row + 2, 2 * column : 2 * column + 2].mean(axis=(0, 1))
    assert pixel(page, "difference", column, row)[:3] == pytest.approx(128 + 2 * difference, abs=2)
    assert pixel(page, "normal", column, row)[:3] == pytest.approx(127.5 + 127.5 * normal, abs=2)
    page.get_by_test_id("gain").select_option("4")
    assert pixel(page, "difference", column, row)[:3] == pytest.approx(np.clip(128 + 4 * difference, 0, 255), abs=4)


def test_the_ring_shows_each_led_as_it_is_lit(page: Page, source: FormulaSource) -> None:
    expect(page.get_by_test_id("led-0")).to_have_attribute("fill", "rgb(255,0,0)")
    expect(page.get_by_test_id("led-4")).to_have_attribute("fill", "rgb(0,255,0)")
    expect(page.get_by_test_id("led-11")).to_have_attribute("fill", "rgb(0,0,255)")
    first, third = (page.get_by_test_id(f"led-{i}") for i in (0, 3))
    assert float(first.get_attribute("cx") or "nan") > 40, "LED 0 is on the right"
    assert float(third.get_attribute("cy") or "nan") < -40, "anticlockwise: LED 3 is at the top"


def test_the_surface_is_drawn_at_every_level(opened_3d: Open, source: FormulaSource) -> None:
    page = opened_3d()
    shown = page.get_by_test_id("surface")
    for detail, name in enumerate(("320 × 240 mesh", "160 × 120 mesh", "2D relief")):
        page.get_by_test_id("detail").select_option(str(detail))
        draw(page, source, 1.0)
        assert page.evaluate("gellight.level") == name
        paint(page)
        bumped = shown.screenshot()
        draw(page, source, 0.0)
        wait_until(page, lambda bumped=bumped: shown.screenshot() != bumped)  # type: ignore[misc]
