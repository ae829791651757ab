"""The page in a real browser: what a visitor sees equals what the sensor said, and what he does reaches the stage."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from gellight.dashboard.server import DashboardServer
from tests.host.browsing import PATIENCE_MS, SIZES, Open, opening
from tests.host.dashboard_source import PIXEL_MM, WIDTH, FormulaSource, RecordingStage, bump, moving_bump

pytestmark = pytest.mark.browser

IMAGES = ("image", "difference", "normal", "depth")


@pytest.fixture
def source() -> FormulaSource:
    return FormulaSource(stage=RecordingStage())


@pytest.fixture
def server(source: FormulaSource) -> Iterator[DashboardServer]:
    with DashboardServer(source, port=0) as server:
        yield server


@pytest.fixture
def opened(browser: Browser, server: DashboardServer) -> Iterator[Open]:
    with opening(browser, server) as open_page:
        yield open_page


@pytest.fixture
def opened_3d(browser_3d: Browser, server: DashboardServer) -> Iterator[Open]:
    with opening(browser_3d, server) as open_page:
        yield open_page


@contextmanager
def playing(source: FormulaSource, fps: float = 10) -> Iterator[None]:
    stop = threading.Event()
    thread = threading.Thread(target=source.play, args=(moving_bump(20), fps, stop))
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def draw(page: Page, source: FormulaSource, depth_mm: float, x_mm: float = 0.0, y_mm: float = 0.0) -> None:
    """Put a bump before the sensor and wait until the page has drawn it."""
    sequence = source.put(bump(depth_mm, x_mm, y_mm))
    page.wait_for_function("sequence => gellight.sequence === sequence", arg=sequence)


def wait_for_calls(source: FormulaSource, page: Page, count: int) -> list[tuple[str, float, float, float] | None]:
    assert source.stage is not None
    waited = 0
    while len(source.stage.calls) < count and waited < PATIENCE_MS:
        page.wait_for_timeout(50)
        waited += 50
    return source.stage.calls


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
    own = (server.url, server.url.replace("http:", "ws:"), f"blob:{server.url}")
    assert [url for url in asked if not url.startswith(own)] == []
    assert any(url.endswith("vendor/three/three.module.js") for url in asked)
    assert any(url.startswith("ws:") for url in asked)


def test_frames_are_drawn_as_they_come(opened_3d: Open, source: FormulaSource) -> None:
    page = opened_3d()
    with playing(source):
        page.wait_for_function("() => gellight.drawn >= 5 && gellight.drawn_fps > 0")
        expect(page.get_by_test_id("state")).to_have_text("live")
        drawn = page.evaluate("gellight.sequence")
        page.wait_for_function("drawn => gellight.sequence > drawn + 3", arg=drawn)


def test_the_numbers_are_the_sensors(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.8764, 4.0, -3.0)
    truth = bump(0.8764, 4.0, -3.0).contact
    assert truth.centroid_mm is not None
    assert page.evaluate("gellight.indentation_mm") == truth.indentation_mm
    assert page.evaluate("gellight.area_mm2") == truth.area_mm2
    shown = {
        "indentation": f"{truth.indentation_mm:.3f}",
        "indentation-um": f"{truth.indentation_mm * 1000:.0f}",
        "area": f"{truth.area_mm2:.1f}",
        "centroid": f"{truth.centroid_mm[0]:.2f}, {truth.centroid_mm[1]:.2f}",
        "fps": "30.0",
        "age-median": "11.2",
        "age-p95": "17.8",
        "dropped": "3",
        "sensor": "formula://bump",
        "verdict": "passed",
        "checked": "frame 1200",
        "check-depth_error_mm": "4.20 µm",
        "check-picture_error_grey": "1.31 grey",
    }
    for name, text in shown.items():
        expect(page.get_by_test_id(name)).to_have_text(text)
    expect(page.get_by_test_id("stages")).to_contain_text("gelnet")


def test_a_failed_self_check_is_shown_as_failed(opened: Open, source: FormulaSource) -> None:
    source.figures["selfcheck"] = {"passed": False, "depth_error_mm": 0.02, "bounds": {"depth_error_mm": 0.01}}
    page = opened()
    expect(page.get_by_test_id("verdict")).to_have_class("verdict failed")
    expect(page.get_by_test_id("check-depth_error_mm")).to_have_class("failed")
    source.figures["selfcheck"] = None
    expect(page.get_by_test_id("checks")).to_have_text("no reference to compare with")
    expect(page.get_by_test_id("verdict")).to_be_empty()


def test_what_the_sensor_says_is_text_never_markup(opened: Open, source: FormulaSource) -> None:
    source.figures["sensor"] = "<img src=x onerror=alert(1)>"
    source.error = "<b>cable</b>"
    page = opened()
    expect(page.get_by_test_id("sensor")).to_have_text("<img src=x onerror=alert(1)>")
    expect(page.get_by_test_id("error")).to_have_text("<b>cable</b>")


def test_the_colour_of_a_depth_does_not_depend_on_the_rest_of_the_frame(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.4)
    alone = pixel(page, "depth", 160, 120)
    rest = pixel(page, "depth", 10, 10)
    draw(page, source, 1.4)
    deeper = pixel(page, "depth", 160, 120)
    assert pixel(page, "depth", 10, 10) == rest
    assert len({tuple(alone), tuple(deeper), tuple(rest)}) == 3
    draw(page, source, 0.4, 5.0, 0.0)
    assert pixel(page, "depth", 160 + round(5.0 / PIXEL_MM / 2), 120) == pytest.approx(alone, abs=2)


def test_the_depth_scale_can_be_chosen_and_says_its_ends(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.4)
    expect(page.get_by_test_id("ticks").locator("li").first).to_have_text("1600 µm")
    before = pixel(page, "depth", 160, 120)
    page.get_by_test_id("scale").select_option("200")
    expect(page.get_by_test_id("ticks").locator("li").first).to_have_text("200 µm")
    above = pixel(page, "depth", 160, 120)
    assert above != before
    assert above[:3] == [255, 92, 160], "what is above the scale is told apart"


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


def test_the_ring_shows_each_led_as_it_is_lit(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.5)
    expect(page.get_by_test_id("led-0")).to_have_attribute("fill", "rgb(255,0,0)")
    expect(page.get_by_test_id("led-4")).to_have_attribute("fill", "rgb(0,255,0)")
    expect(page.get_by_test_id("led-11")).to_have_attribute("fill", "rgb(0,0,255)")
    first, third = (page.get_by_test_id(f"led-{i}") for i in (0, 3))
    assert float(first.get_attribute("cx") or "nan") > 40, "LED 0 is on the right"
    assert float(third.get_attribute("cy") or "nan") < -40, "anticlockwise: LED 3 is at the top"


@pytest.mark.parametrize(("canvas", "size"), list(zip(IMAGES, 2 * SIZES, strict=True)), ids=IMAGES)
def test_a_press_of_the_mouse_arrives_where_it_points(
    opened: Open, source: FormulaSource, canvas: str, size: dict[str, int]
) -> None:
    page = opened()
    page.set_viewport_size(size)  # type: ignore[arg-type]
    draw(page, source, 0.5)
    box = page.get_by_test_id(canvas).bounding_box()
    assert box is not None
    mm_per_pixel = WIDTH * PIXEL_MM / min(box["width"], box["height"] * 4 / 3)
    right, down = 41, -23
    page.mouse.move(box["x"] + box["width"] / 2 + right, box["y"] + box["height"] / 2 + down)
    page.mouse.down()
    name, depth, x_mm, y_mm = wait_for_calls(source, page, 1)[0] or ("", 0.0, 0.0, 0.0)
    assert (name, depth) == ("BALL", 0.8)
    assert x_mm == pytest.approx(right * mm_per_pixel, abs=mm_per_pixel)
    assert y_mm == pytest.approx(down * mm_per_pixel, abs=mm_per_pixel)
    page.mouse.up()
    assert wait_for_calls(source, page, 2)[-1] is None, "letting go releases"


def test_dragging_moves_the_press_and_stays_inside_the_view(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.5)
    box = page.get_by_test_id("depth").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    wait_for_calls(source, page, 1)
    page.mouse.move(box["x"] - 300, box["y"] + box["height"] / 2)
    calls = wait_for_calls(source, page, 2)
    assert calls[-1] is not None
    assert calls[-1][2] == pytest.approx(-WIDTH * PIXEL_MM / 2, abs=0.02)
    page.mouse.up()
    expect(page.get_by_test_id("press-hint")).not_to_have_class("hint wrong")


def test_slider_wheel_and_chooser_change_what_is_pressed(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.5)
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


def test_an_object_can_be_kept_pressed(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.5)
    page.get_by_test_id("hold").check()
    page.get_by_test_id("image").click()
    page.wait_for_timeout(300)
    calls = wait_for_calls(source, page, 1)
    assert None not in calls


def test_what_the_stage_refuses_is_told_to_the_visitor(opened: Open, source: FormulaSource) -> None:
    def refuse(*_: object) -> None:
        raise ValueError("the gel is worn out")

    assert source.stage is not None
    source.stage.press = refuse  # type: ignore[method-assign]
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


def test_frames_that_stop_are_shown_as_old(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 0.5)
    expect(page.get_by_test_id("state")).to_have_text("live")
    page.wait_for_function("() => gellight.state === 'stale'")
    assert page.evaluate("gellight.age_ms") > 1000
    before = page.get_by_test_id("state").text_content() or ""
    assert before.startswith("no frame ")
    expect(page.get_by_test_id("state")).not_to_have_text(before)
    draw(page, source, 0.6)
    page.wait_for_function("() => gellight.state === 'live'")


def test_a_page_opened_on_a_dead_camera_does_not_call_its_last_frame_live(opened: Open, source: FormulaSource) -> None:
    frame = bump(0.5, 0, 0)
    source.put(frame)
    object.__setattr__(frame.camera_frame, "time_s", frame.camera_frame.time_s - 60)
    page = opened()
    page.wait_for_function("() => gellight.drawn === 1 && gellight.age_ms !== null")
    assert page.evaluate("gellight.age_ms") > 50_000
    assert page.evaluate("gellight.state") == "stale"


def test_the_page_comes_back_after_the_server(opened: Open, source: FormulaSource, server: DashboardServer) -> None:
    page = opened()
    draw(page, source, 0.5)
    server.stop()
    expect(page.get_by_test_id("state")).to_have_text("reconnecting")
    with DashboardServer(source, port=int(server.url.split(":")[2].strip("/"))):
        page.wait_for_function("() => gellight.state !== 'lost'")
        draw(page, source, 0.7)
        expect(page.get_by_test_id("state")).to_have_text("live")
        page.get_by_test_id("press-here").click()
        assert wait_for_calls(source, page, 1)[-1] == ("BALL", 0.8, 0.0, 0.0)


def test_a_press_that_was_lost_with_the_server_blocks_no_later_one(
    opened: Open, source: FormulaSource, server: DashboardServer, caplog: pytest.LogCaptureFixture
) -> None:
    assert source.stage is not None
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
    with DashboardServer(source, port=int(server.url.split(":")[2].strip("/"))):
        draw(page, source, 0.7)
        page.get_by_test_id("object-WAVE").click()
        page.get_by_test_id("press-here").click()
        assert wait_for_calls(source, page, 2)[-1] == ("WAVE", 0.8, 0.0, 0.0)


def test_detail_falls_when_pictures_take_long_and_can_be_fixed(opened: Open) -> None:
    page = opened()
    levels = page.evaluate("""async () => {
        const { Detail } = await import("./detail.js");
        const feed = (detail, ms, count) => { for (let i = 0; i < count; i++) detail.note(ms); return detail.level; };
        const slow = new Detail(0), quick = new Detail(0), fixed = new Detail(0), asleep = new Detail(0);
        fixed.choose(0);
        return [feed(slow, 300, 7), feed(slow, 300, 7), feed(slow, 300, 50), feed(quick, 30, 200), feed(fixed, 300, 50),
                feed(asleep, 60000, 50)];
    }""")
    assert levels == [1, 2, 2, 0, 0, 0]


def test_without_webgl_the_surface_is_a_relief(opened: Open, source: FormulaSource) -> None:
    page = opened()
    draw(page, source, 1.0)
    assert page.evaluate("gellight.level") == "2D relief"
    expect(page.get_by_test_id("detail")).to_be_disabled()


@pytest.mark.parametrize("detail", ["0", "1", "2"])
def test_the_surface_is_drawn_at_every_level(opened_3d: Open, source: FormulaSource, detail: str) -> None:
    page = opened_3d()
    page.get_by_test_id("detail").select_option(detail)
    draw(page, source, 1.0)
    name = ("320 × 240 mesh", "160 × 120 mesh", "2D relief")[int(detail)]
    assert page.evaluate("gellight.level") == name
    shown = page.get_by_test_id("surface")
    page.wait_for_timeout(500)
    bumped = shown.screenshot()
    draw(page, source, 0.0)
    page.wait_for_timeout(500)
    assert shown.screenshot() != bumped


@pytest.mark.parametrize("size", SIZES, ids=lambda size: str(size["width"]))
@pytest.mark.parametrize(
    "error", [None, "/dev/video0 delivers nothing: " + "check the cable " * 5], ids=["well", "error"]
)
def test_nothing_overlaps_and_everything_is_in_sight(
    opened: Open, source: FormulaSource, size: dict[str, int], error: str | None
) -> None:
    source.error = error
    source.figures["sensor"] = "sim://?" + "object=BALL&" * 10
    source.figures["stage_ms"] = dict.fromkeys(("difference", "mask", "gradient", "depth", "normals", "contact"), 2.0)
    page = opened()
    page.set_viewport_size(size)  # type: ignore[arg-type]
    draw(page, source, 1.0)
    expect(page.get_by_test_id("verdict")).to_have_text("passed")
    expect(page.get_by_test_id("error")).to_have_text((error or "").strip())
    assert page.evaluate(OVERLAPS) == []
    assert page.evaluate(OUTSIDE) == []


OVERLAPS = """() => {
    const box = (element) => {
        const range = document.createRange(); // a heading's words, not its whole line
        range.selectNodeContents(element);
        return (element.tagName === "H2" ? range : element).getBoundingClientRect();
    };
    const beside = (a, b) => a.right <= b.left + 1 || b.right <= a.left + 1;
    const apart = (a, b) => beside(a, b) || a.bottom <= b.top + 1 || b.bottom <= a.top + 1;
    const name = (element) => element.id || element.className || element.textContent;
    const wrong = [];
    for (const css of ["main > *, aside > *", "header > *", ".panel > *", ".contact-row > *", ".buttons > *", "td"]) {
        const seen = [...document.querySelectorAll(css)].filter((e) => e.checkVisibility() && e.tagName !== "ASIDE");
        seen.forEach((e, i) => {
            for (const f of seen.slice(i + 1)) if (!apart(box(e), box(f))) wrong.push([name(e), name(f)]);
        });
    }
    return wrong;
}"""
OUTSIDE = """() => {
    const name = (element) => element.id || element.className || element.textContent;
    const out = ({ left, top, right, bottom }) => left < 0 || top < 0 || right > innerWidth || bottom > innerHeight;
    const cut = (element) => element.scrollWidth > element.clientWidth + 1;
    const shown = [...document.querySelectorAll(".panel, .error, header > *")].filter((e) => e.checkVisibility());
    const wrong = shown.filter((e) => out(e.getBoundingClientRect()));
    wrong.push(...[...document.querySelectorAll(".objects button, td, dd, h2, header > :not(#sensor)")].filter(cut));
    const aside = document.querySelector("aside");
    if (aside.scrollHeight > aside.clientHeight) wrong.push(aside);
    return wrong.filter((e) => e.checkVisibility()).map(name);
}"""
