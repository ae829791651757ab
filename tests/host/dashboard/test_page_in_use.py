"""The page in a real browser: what a visitor does reaches the stage, and what is lost is told and comes back."""

import json
import threading
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from gellight.daemon.assembly import open_session
from gellight.dashboard.server import DashboardServer
from gellight.frames.frames import Contact
from tests.helpers.browsing import PATIENCE_MS, SIZES, Open, becomes_live, draw, opening, paint, wait_until
from tests.helpers.dashboard_source import PIXEL_MM, WIDTH, FormulaSource, bump
from tests.helpers.settings import loaded

pytestmark = pytest.mark.browser

IMAGES = ("image", "difference", "normal", "depth")


def wait_for_calls(source: FormulaSource, page: Page, count: int) -> list[tuple[str, float, float, float] | None]:
    wait_until(page, lambda: len(source.stage.calls) >= count)
    return source.stage.calls


def test_a_press_of_the_mouse_arrives_where_it_points(page: Page, source: FormulaSource) -> None:
    for number, (canvas, size) in enumerate(zip(IMAGES, 2 * SIZES, strict=True)):
        page.set_viewport_size(size)  # type: ignore[arg-type]
        paint(page)
        page.get_by_test_id(canvas).scroll_into_view_if_needed()
        box = page.get_by_test_id(canvas).bounding_box()
        mm_per_pixel = WIDTH * PIXEL_MM / min(box["width"], box["height"] * 4 / 3)
        right, down = 41 + number, -23
        page.mouse.move(box["x"] + box["width"] / 2 + right, box["y"] + box["height"] / 2 + down)
        page.mouse.down()
        name, depth, x_mm, y_mm = wait_for_calls(source, page, 2 * number + 1)[-1] or ("", 0.0, 0.0, 0.0)
        assert (name, depth) == ("BALL", 0.8), canvas
        assert x_mm == pytest.approx(right * mm_per_pixel, abs=mm_per_pixel), canvas
        assert y_mm == pytest.approx(down * mm_per_pixel, abs=mm_per_pixel), canvas
        page.mouse.up()
        assert wait_for_calls(source, page, 2 * number + 2)[-1] is None, "letting go releases"


def test_dragging_moves_the_press_and_stays_inside_the_view(page: Page, source: FormulaSource) -> None:
    box = page.get_by_test_id("depth").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    wait_for_calls(source, page, 1)
    page.mouse.move(box["x"] - 300, box["y"] + box["height"] / 2)
    calls = wait_for_calls(source, page, 2)
    assert calls[-1][2] == pytest.approx(-WIDTH * PIXEL_MM / 2, abs=0.02)
    page.mouse.up()
    expect(page.get_by_test_id("press-hint")).not_to_have_class("hint wrong")


def test_slider_wheel_and_chooser_change_what_is_pressed(page: Page, source: FormulaSource) -> None:
    page.get_by_test_id("object-SINWAVE").click()
    page.get_by_test_id("press-here").click()
    assert wait_for_calls(source, page, 1) == [("SINWAVE", 0.8, 0.0, 0.0)]
    page.get_by_test_id("press-depth").fill("1.25")
    assert wait_for_calls(source, page, 2)[-1] == ("SINWAVE", 1.25, 0.0, 0.0)
    page.get_by_test_id("image").hover()
    page.mouse.wheel(0, -100)
    assert wait_for_calls(source, page, 3)[-1] == ("SINWAVE", 1.3, 0.0, 0.0)
    expect(page.get_by_test_id("press-depth-mm")).to_have_text("1.30 mm")
    page.get_by_test_id("object-QUCAVE").click()
    assert wait_for_calls(source, page, 4)[-1] == ("QUCAVE", 1.3, 0.0, 0.0)
    expect(page.get_by_test_id("stage-now")).to_have_text("you: QUCAVE 1.30 mm")
    page.get_by_test_id("release").click()
    assert wait_for_calls(source, page, 5)[-1] is None
    page.mouse.wheel(0, 100)
    page.wait_for_timeout(300)
    assert len(wait_for_calls(source, page, 5)) == 5, "depth alone presses nothing"


def test_an_object_can_be_kept_pressed(page: Page, source: FormulaSource) -> None:
    page.get_by_test_id("hold").check()
    page.get_by_test_id("image").click()
    page.wait_for_timeout(300)
    calls = wait_for_calls(source, page, 1)
    assert None not in calls


def test_what_the_stage_refuses_is_told_to_the_visitor(opened: Open, source: FormulaSource) -> None:
    source.stage.press = Mock(side_effect=ValueError("the gel is worn out"))  # type: ignore[method-assign]
    page = opened()
    draw(page, source, 0.5)
    page.get_by_test_id("press-here").click()
    expect(page.get_by_test_id("press-hint")).to_have_text("the gel is worn out")


def test_a_real_sensor_offers_no_press(opened: Open, source: FormulaSource) -> None:
    source.stage = None
    page = opened()
    draw(page, source, 0.5)
    expect(page.get_by_test_id("sensor")).to_have_text("formula://bump")
    expect(page.get_by_test_id("press")).to_be_hidden()
    page.get_by_test_id("image").click()
    expect(page.get_by_test_id("press-hint")).to_be_hidden()


def test_frames_that_stop_are_shown_as_old(page: Page, source: FormulaSource) -> None:
    becomes_live(page, source)
    page.wait_for_function("() => gellight.state === 'stale'")
    assert page.evaluate("gellight.age_ms") > 1000
    before = page.get_by_test_id("state").text_content() or ""
    assert before.startswith("no frame ")
    expect(page.get_by_test_id("state")).not_to_have_text(before)
    becomes_live(page, source)


def test_a_page_opened_on_a_dead_camera_does_not_call_its_last_frame_live(opened: Open, source: FormulaSource) -> None:
    frame = bump(0.5, 0, 0)
    source.put(frame)
    object.__setattr__(frame.camera_frame, "time_s", frame.camera_frame.time_s - 60)
    page = opened()
    page.wait_for_function("() => gellight.drawn === 1 && gellight.age_ms !== null")
    assert page.evaluate("gellight.age_ms") > 50_000
    assert page.evaluate("gellight.state") == "stale"


def test_a_press_that_was_lost_with_the_server_blocks_no_later_one(
    opened: Open, source: FormulaSource, server: DashboardServer, caplog: pytest.LogCaptureFixture
) -> None:
    begun, gate, press = threading.Event(), threading.Event(), source.stage.press

    def slow(*where: Any) -> None:
        begun.set()
        gate.wait(PATIENCE_MS / 1000)
        press(*where)

    source.stage.press = slow  # type: ignore[method-assign]
    page = opened()
    draw(page, source, 0.5)
    page.get_by_test_id("press-here").click()
    assert begun.wait(PATIENCE_MS / 1000)
    stopping = threading.Thread(target=server.stop)
    stopping.start()
    expect(page.get_by_test_id("state")).to_have_text("reconnecting")
    gate.set()
    stopping.join()
    assert [record for record in caplog.records if record.levelname == "ERROR"] == []
    with DashboardServer(source, port=int(server.base.split(":")[2].strip("/"))):
        draw(page, source, 0.7)
        page.get_by_test_id("object-WAVE").click()
        page.get_by_test_id("press-here").click()
        assert wait_for_calls(source, page, 2)[-1] == ("WAVE", 0.8, 0.0, 0.0)


def test_a_frame_without_depth_shows_its_picture_and_no_figures(page: Page, source: FormulaSource) -> None:
    """As a light sequence gives them, under a light that the network does not know."""
    felt = bump(0.5, 0.0, 0.0)
    nothing = Contact(mask=np.zeros_like(felt.contact.mask), area_mm2=np.nan, indentation_mm=np.nan, centroid_mm=None)
    empty = {name: np.full_like(getattr(felt, name), np.nan) for name in ("depth_mm", "gradient_map")}
    sequence = source.put(replace(felt, contact=nothing, **empty))
    page.wait_for_function("sequence => gellight.sequence === sequence", arg=sequence)
    expect(page.get_by_test_id("indentation")).to_have_text("–")
    page.get_by_test_id("pause").click()
    draw_after = source.put(bump(0.75, 0.0, 0.0))
    page.get_by_test_id("pause").click()
    page.wait_for_function("sequence => gellight.sequence === sequence", arg=draw_after)
    expect(page.get_by_test_id("indentation")).to_have_text("0.750")


def test_a_visitor_of_the_demo_presses_the_ball_and_sees_its_true_depth(browser: Browser) -> None:
    settings = loaded({"sensor.url": "sim://?programme=0"})
    with (
        open_session(settings) as daemon,
        DashboardServer(daemon, port=0) as server,
        opening(browser, server) as open_page,
    ):
        page = open_page()
        expect(page.get_by_test_id("state")).to_have_text("live")
        page.get_by_test_id("object-BALL").click()
        page.get_by_test_id("press-depth").fill("1")
        box = page.get_by_test_id("image").bounding_box()
        page.mouse.move(box["x"] + 0.65 * box["width"], box["y"] + 0.4 * box["height"])
        page.mouse.down()
        page.wait_for_function("() => window.gellight.indentation_mm > 0.9")
        seen = json.loads(page.evaluate("() => JSON.stringify(window.gellight)"))
        truth = daemon.wait_frame(0, 20).camera_frame.truth
        page.mouse.up()
        page.wait_for_function("() => window.gellight.indentation_mm === 0")
    assert seen["indentation_mm"] == pytest.approx(float(truth.depth_mm.max()), rel=0.10)
    assert seen["centroid_mm"] == pytest.approx([0.15 * 640 * 0.0588, -0.1 * 480 * 0.0588], abs=0.25), (
        "it is felt where the pointer is"
    )
    assert seen["fps"] > 0
