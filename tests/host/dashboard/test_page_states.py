"""What the page says of itself: what is not of now is not shown as if it were, and the page says why."""

import json
import threading
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from gellight.dashboard import messages
from gellight.dashboard.server import DashboardServer
from tests.helpers.browsing import Open, draw, wait_until
from tests.helpers.dashboard_source import FormulaSource, bump

pytestmark = pytest.mark.browser

DIM = "() => getComputedStyle(document.getElementById('indentation')).color"
NORMAL = "() => getComputedStyle(document.body).color"
NO_TIMER = "() => { window.setTimeout = () => -1; }"


def test_when_the_server_is_gone_the_values_are_dim_and_nothing_can_be_pressed(
    page: Page, source: FormulaSource, server: DashboardServer
) -> None:
    expect(page.get_by_test_id("indentation")).to_have_text("0.500")
    expect(page.get_by_test_id("press-here")).to_be_enabled()
    page.evaluate(NO_TIMER)  # the page's own attempts, else one of them may succeed before the button is pressed
    server.stop()
    banner = page.get_by_test_id("banner-lost")
    expect(banner).to_contain_text("The server is gone")
    expect(page.get_by_test_id("indentation")).to_have_text("0.500")
    assert page.evaluate(DIM) != page.evaluate(NORMAL)
    assert "grayscale" in page.evaluate("getComputedStyle(document.getElementById('depth')).filter")
    expect(page.get_by_test_id("press-here")).to_be_disabled()
    expect(page.get_by_test_id("press-hint")).to_have_text("The server is gone.")
    with DashboardServer(source, port=int(server.base.split(":")[2].strip("/"))):
        banner.get_by_role("button", name="Try now").click(no_wait_after=True)
        expect(banner).to_have_count(0)
        expect(page.get_by_test_id("press-here")).to_be_enabled()


def test_a_running_calibration_is_said_and_forbids_presses(
    opened: Open, source: FormulaSource, server: DashboardServer
) -> None:
    page = opened()
    hold_status(page, {"calibrating": True})
    draw(page, source, 0.5)
    expect(page.get_by_test_id("state")).to_have_text("calibrating")
    banner = page.get_by_test_id("banner-calibrating")
    expect(banner.get_by_role("link")).to_have_attribute("href", "calibrate.html")
    expect(page.get_by_test_id("press-here")).to_be_disabled()
    page.get_by_test_id("image").click()
    page.wait_for_timeout(300)
    assert source.stage.calls == []


def test_an_object_that_is_being_prepared_is_named_and_moves_nothing(opened: Open, source: FormulaSource) -> None:
    said = source.stage.status
    page = opened()
    draw(page, source, 0.5)
    count_movements(page)
    source.stage.status = lambda: {**said(), "preparing": "TSTEP"}  # type: ignore[method-assign]
    expect(page.get_by_test_id("state")).to_have_text("preparing")
    expect(page.get_by_test_id("stage-now")).to_have_text("preparing TSTEP")
    source.stage.status = lambda: {**said(), "preparing": ""}  # type: ignore[method-assign]
    expect(page.get_by_test_id("stage-now")).to_have_text("programme: nothing pressed")
    assert page.evaluate("movements") == 0
    page.set_viewport_size({"width": 700, "height": 800})
    page.wait_for_function("() => movements > 0")


def count_movements(page: Any) -> None:
    """Count from now on the painted frames in which a picture stands elsewhere than in the one before."""
    page.evaluate("""() => {
        const places = () => [...document.querySelectorAll(".picture, .stagebox")].map((picture) => {
            const { x, y, width, height } = picture.getBoundingClientRect();
            return [x, y + scrollY, width, height].join();
        }).join("; ");
        let before = places();
        window.movements = 0;
        const look = () => {
            const now = places();
            movements += now !== before;
            before = now;
            requestAnimationFrame(look);
        };
        look();
    }""")


def test_an_object_that_is_being_prepared_can_be_given_up(opened: Open, source: FormulaSource) -> None:
    """Release does not wait for the answer to the press, whatever the status says of it."""
    stage, done = source.stage, threading.Event()
    stage.press = lambda *_: done.wait(60)  # type: ignore[method-assign, assignment]
    try:
        page = opened()
        draw(page, source, 0.5)
        page.get_by_test_id("object-TSTEP").click()
        page.get_by_test_id("press-here").click()
        page.get_by_test_id("release").click()
        wait_until(page, lambda: bool(stage.calls))
        assert stage.calls == [None], "released while the press was still being computed"
    finally:
        done.set()


def hold_status(page: Any, more: dict[str, object]) -> None:
    """Open the page again, and add `more` to each status on its way from the server."""

    def pass_on(route: Any) -> None:
        server = route.connect_to_server()
        server.on_message(lambda m: route.send(json.dumps({**json.loads(m), **more}) if isinstance(m, str) else m))

    page.route_web_socket("**/ws", pass_on)
    page.reload()


def test_a_slow_link_is_told_from_a_sensor_that_sends_nothing(opened: Open) -> None:
    """The link is slow when the status comes late or not at all; an old frame alone is the sensor's fault."""
    said = opened().evaluate("""async () => {
        const { Link } = await import("./link.js");
        const { judge } = await import("./state.js");
        const link = new Link();
        const name = (nowS, frameS) => judge({
            connected: true, paused: false, status: {}, ageS: link.ageS(nowS, frameS), behindS: link.behindS(nowS),
        });
        const found = [];
        link.note(100, 10);
        found.push(name(100.1, 10).name); // a frame of now
        link.note(103, 13);
        found.push(name(103.1, 10).text); // an old frame, while the status comes in time
        link.note(106, 14);
        found.push(name(106.1, 13.9).text); // a status that took two seconds longer than the first
        link.note(106.2, 16.2);
        found.push(name(106.3, 16.2).name);
        found.push(name(109.05, 16.2).text); // silence
        link.reset();
        found.push(name(110, 16.2).name);
        return found;
    }""")
    assert said == ["live", "no frame 3.1 s", "link 2.0 s behind", "live", "link 2.6 s behind", "connected"]


def test_banners_stand_in_one_place_the_worst_first_each_with_its_action(opened: Open, source: FormulaSource) -> None:
    drift = {"kind": "drift", "severity": "notice", "text": "the light is 96 %", "figures": {}}
    source.figures["watch"] = {"state": "at rest", "findings": [drift]}
    page = opened()
    draw(page, source, 0.5)
    page.get_by_test_id("pause").click()
    expect(page.get_by_test_id("banner-paused")).to_be_visible()
    source.error = "the cable is out"
    expect(page.get_by_test_id("banner-error")).to_be_visible()
    banners = page.get_by_test_id("banners").locator("section:visible")
    expect(banners).to_have_count(3)
    for banner in banners.all():
        assert banner.locator("button, a").count() >= 1
    texts = banners.all_text_contents()
    assert ["cable" in text for text in texts].index(True) < ["Paused" in text for text in texts].index(True)
    page.get_by_test_id("banner-error").get_by_role("button", name="Diagnostics").click()
    expect(page.get_by_test_id("stages")).to_be_visible()
    source.error = None
    expect(page.get_by_test_id("banner-error")).to_have_count(0)


def test_a_double_click_on_the_surface_turns_it_back(opened_3d: Open, source: FormulaSource) -> None:
    page = opened_3d()
    turned = page.evaluate("""async () => {
        const { Orbit } = await import("./orbit.js");
        const box = document.createElement("div");
        document.body.append(box);
        let changes = 0;
        const orbit = new Orbit(box, () => changes++);
        const start = [orbit.azimuth, orbit.elevation, orbit.distance];
        for (const key of ["ArrowLeft", "ArrowDown", "+"]) box.dispatchEvent(new KeyboardEvent("keydown", { key }));
        const away = [orbit.azimuth, orbit.elevation, orbit.distance];
        box.dispatchEvent(new MouseEvent("dblclick"));
        const back = [orbit.azimuth, orbit.elevation, orbit.distance];
        return [away.map((value, i) => value !== start[i]), back.join() === start.join(), changes];
    }""")
    assert turned == [[True, True, True], True, 4]


def test_a_frame_of_another_version_is_said_with_the_remedy_and_the_page_goes_on_after_it(
    page: Page, source: FormulaSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(messages, "VERSION", messages.VERSION + 1)
        source.put(bump(0.6, 0, 0))
        banner = page.get_by_test_id("banner-undecoded")
        expect(banner).to_contain_text("the server speaks another version: reload this page")
        expect(banner.get_by_role("button", name="Reload")).to_be_visible()
    draw(page, source, 0.7)
    expect(banner).to_have_count(0)
