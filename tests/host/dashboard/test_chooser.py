"""Several sensors on one page: what is asked of one reaches that one, and one that failed leaves the others alone."""

import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from gellight.dashboard.access import cookie
from gellight.dashboard.chooser import Choice, Chooser
from gellight.dashboard.server import DashboardServer, PageServer
from tests.helpers.browsing import draw, opening
from tests.helpers.dashboard_source import FormulaSource, RecordingStage, bump
from tests.helpers.page_client import get, pages


class Three:
    """Two sensors that work, and one that has failed."""

    def __init__(self, stack: ExitStack, token: str = "") -> None:
        self.sources = [FormulaSource(stage=RecordingStage()) for _ in range(2)]
        self.inner = [stack.enter_context(DashboardServer(source, port=0)) for source in self.sources]
        self.choices = {
            "1": Choice(key="1", sensor="sensor://left", error=None, address=self.inner[0].url),
            "2": Choice(key="2", sensor="sensor://right", error=None, address=self.inner[1].url),
            "3": Choice(key="3", sensor="sensor://gone", error="it was unplugged", address=""),
        }
        chooser = Chooser(lambda: self.choices)
        self.server = stack.enter_context(PageServer(chooser.application, port=0, token=token))


@pytest.fixture
def three() -> Iterator[Three]:
    with ExitStack() as stack:
        yield Three(stack)


def ask(server: PageServer, path: str, **options: Any) -> tuple[int, str, Mapping[str, str]]:
    """Return status, text and headers of the answer, asked without the token in the server's address."""
    return get(server.base + path, **options)


def test_the_page_lists_the_sensors_and_begins_with_one_that_works(three: Three) -> None:
    status, text, _ = ask(three.server, "sensors")
    assert status == 200
    assert json.loads(text) == [
        {"key": "1", "sensor": "sensor://left", "error": None},
        {"key": "2", "sensor": "sensor://right", "error": None},
        {"key": "3", "sensor": "sensor://gone", "error": "it was unplugged"},
    ]
    assert ask(three.server, "")[2]["Location"] == "1/"
    three.choices["1"] = Choice(key="1", sensor="sensor://left", error="broken", address="")
    assert ask(three.server, "")[2]["Location"] == "2/"


def test_every_sensor_has_its_page_status_and_files(three: Three) -> None:
    three.sources[0].frames, three.sources[1].frames = 11, 22  # type: ignore[attr-defined]
    for key in ("1", "2"):
        assert "<title>GelLight</title>" in ask(three.server, f"{key}/")[1]
        assert json.loads(ask(three.server, f"{key}/status")[1])["type"] == "status"
        status, text, headers = ask(three.server, f"{key}/main.js")
        assert status == 200
        assert headers["Content-Type"].endswith("/javascript")
        assert "offerSensors" in text
        assert ask(three.server, f"{key}/main.js", headers={"If-None-Match": headers["ETag"]})[0] == 304
        port = three.server.base.rsplit(":", 1)[1].strip("/")
        assert f"ws://127.0.0.1:{port}" in headers["Content-Security-Policy"]


@pytest.mark.parametrize(
    ("path", "status", "said"),
    [
        ("3/", 502, "sensor://gone: it was unplugged"),
        ("3/ws", 502, "it was unplugged"),
        ("9/status", 404, "no sensor '9': choose one of 1, 2, 3"),
        ("1/../../secret", 404, ""),
        ("1/nothing", 404, "no file"),
    ],
)
def test_what_is_not_there_is_answered_with_the_reason(three: Three, path: str, status: int, said: str) -> None:
    answer = ask(three.server, path)
    assert answer[0] == status
    assert said in answer[1]


def test_a_sensor_that_is_being_started_is_asked_for_again(three: Three) -> None:
    three.choices["3"] = replace(three.choices["3"], error=None)
    status, text, headers = ask(three.server, "3/status")
    assert status == 503
    assert "it is being started" in text
    assert headers["Retry-After"] == "1"


def test_health_names_what_has_failed(three: Three) -> None:
    status, text, _ = ask(three.server, "health")
    assert status == 503
    assert json.loads(text) == {"ok": False, "errors": {"sensor://gone": "it was unplugged"}}
    del three.choices["3"]
    assert ask(three.server, "health")[0] == 200


def test_frames_and_commands_go_to_the_sensor_of_the_address(three: Three) -> None:
    for source, depth_mm in zip(three.sources, (0.25, 0.75), strict=True):
        source.put(bump(depth_mm, 0, 0))
    with pages() as connect:
        page = connect(three.server.base + "2/")
        page.credit()
        assert page.frame()["contact"]["indentation_mm"] == pytest.approx(0.75, abs=0.01)
        assert page.answer(type="press", object="BALL", depth_mm=0.5, x_mm=1, y_mm=2)["type"] == "done"
    left, right = (source.stage.calls for source in three.sources if source.stage)
    assert left == []
    assert right == [("BALL", 0.5, 1.0, 2.0)]


def test_a_sensor_that_ends_closes_its_pages_alone(three: Three) -> None:
    with pages() as connect:
        left, right = connect(three.server.base + "1/"), connect(three.server.base + "2/")
        three.inner[0].stop()
        assert left.is_closed()
        assert right.text("status")
    status, text, _ = ask(three.server, "1/status")
    assert status == 502
    assert "does not answer" in text


def test_another_site_and_a_missing_token_are_refused_before_anything_is_passed_on() -> None:
    with ExitStack() as stack:
        three = Three(stack, token="t" * 20)
        for path in ("1/status", "1/ws", "sensors", "health", ""):
            assert ask(three.server, path)[0] == 401
        cookies = {cookie(three.server.base.strip("/")): "t" * 20}
        assert ask(three.server, "1/status", cookies=cookies)[0] == 200
        assert ask(three.server, "1/status", cookies=cookies, headers={"Origin": "http://example.org"})[0] == 403


@pytest.mark.browser
def test_a_visitor_chooses_the_sensor(browser: Browser, three: Three) -> None:
    with opening(browser, three.server) as opened:
        page = opened()
        draw(page, three.sources[0], 0.25)
        chooser = page.get_by_test_id("sensors")
        expect(chooser).to_be_visible()
        expect(chooser.locator("option")).to_have_text(["sensor://left", "sensor://right", "sensor://gone (failed)"])
        expect(chooser).to_have_value("1")
        chooser.select_option("2")
        page.wait_for_url("**/2/**")
        draw(page, three.sources[1], 0.75)
        expect(page.get_by_test_id("sensors")).to_have_value("2")
        assert page.evaluate("gellight.indentation_mm") == pytest.approx(0.75, abs=0.01)


@pytest.mark.browser
def test_where_there_is_one_sensor_there_is_nothing_to_choose(browser: Browser, three: Three) -> None:
    with opening(browser, three.inner[0]) as opened:
        page = opened()
        draw(page, three.sources[0], 0.25)
        page.wait_for_timeout(300)
        expect(page.get_by_test_id("sensors")).to_be_hidden()
