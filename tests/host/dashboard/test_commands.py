"""Commands of the page: what reaches the sensor, and what happens to nonsense."""

import json
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any
from unittest.mock import Mock

import pytest

from gellight.base.errors import InputError
from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource, bump
from tests.helpers.page_client import Page, bearer, get, post
from tests.helpers.scripted_calibration import Scripted
from tests.helpers.waiting import eventually

PRESS = {"type": "press", "object": "BALL", "depth_mm": 0.5, "x_mm": 0.0, "y_mm": 0.0}
RELEASE = {"type": "release"}


def test_press_and_release_reach_the_stage(server: DashboardServer, source: FormulaSource) -> None:
    press = {"type": "press", "object": "WAVE", "depth_mm": 0.75, "x_mm": -3, "y_mm": 4.5}
    for call in (press, RELEASE):
        status, answer = post(server.base, call)
        assert (status, answer["time_s"] > 0) == (200, True)
    assert source.stage.calls == [("WAVE", 0.75, -3.0, 4.5), None]


def test_a_running_calibration_is_in_the_status_and_nobody_else_may_press(
    server: DashboardServer, client: Page, source: FormulaSource
) -> None:
    source.calibrating = True
    while client.text("status")["calibrating"] is not True:
        pass
    for call in (PRESS, RELEASE):
        status, answer = post(server.base, call)
        assert (status, "a calibration is running" in answer["message"]) == (409, True)
    source.calibrating = False
    assert post(server.base, PRESS)[0] == 200
    assert source.stage.calls == [("BALL", 0.5, 0.0, 0.0)]


@contextmanager
def press_being_computed(server: DashboardServer, source: FormulaSource) -> Iterator[Future[tuple[int, Any]]]:
    """Ask for a press, and wait until the stage computes it, which goes on until it `may_prepare`."""
    source.stage.may_prepare.clear()
    with ThreadPoolExecutor(1) as elsewhere:
        pressed = elsewhere.submit(post, server.base, PRESS)
        eventually(lambda: source.stage.prepared)
        yield pressed
        source.stage.may_prepare.set()


def test_a_press_is_computed_before_it_is_made_and_stops_neither_frames_nor_status(
    server: DashboardServer, client: Page, source: FormulaSource
) -> None:
    client.credit(8)
    with press_being_computed(server, source) as pressed:
        sequence = source.put(bump(1.0, 0, 0))
        assert client.frame()["sequence"] == sequence
        first = client.text("status")
        assert client.text("status")["now_s"] > first["now_s"]
        assert source.stage.calls == []
    assert pressed.result()[0] == 200
    assert source.stage.calls == [("BALL", 0.5, 0.0, 0.0)]


def test_an_object_that_is_released_while_it_is_computed_is_not_pressed(
    server: DashboardServer, source: FormulaSource
) -> None:
    with press_being_computed(server, source) as pressed:
        assert post(server.base, RELEASE)[0] == 200
    assert pressed.result()[0] == 200
    assert source.stage.calls == [None]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "it is no JSON"),
        ("[]", "is not allowed: give an object"),
        ("{}", "it has no type"),
        ('{"type": "explode"}', "explode"),
        (json.dumps(PRESS | {"depth_mm": float("nan")}), "depth_mm = nan is not allowed: give a finite number"),
        (json.dumps(PRESS | {"x_mm": float("inf")}), "x_mm = inf is not allowed: give a finite number"),
        (json.dumps(PRESS | {"y_mm": "0"}), "y_mm = '0' is not allowed: give a number"),
        (json.dumps(PRESS | {"force": 1}), "force is unknown: leave it out"),
        ('{"type": "press"}', "object is missing"),
    ],
)
def test_a_bad_command_is_answered_and_harms_nothing(
    server: DashboardServer, source: FormulaSource, text: str, said: str
) -> None:
    status, answer = post(server.base, text.encode())
    assert (status, said in answer["message"]) == (400, True), answer
    assert post(server.base, PRESS)[0] == 200
    assert source.stage.calls == [("BALL", 0.5, 0.0, 0.0)]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "it is no JSON"),
        ("7", "give an object"),
        (b"\0\1", "it is no JSON"),
        ('{"count": 0}', "count = 0 is not allowed: give a number at least 1"),
        ('{"count": 1e99}', "is not allowed: give a whole number"),
        (json.dumps(PRESS), "count is missing"),
    ],
)
def test_what_is_no_credit_is_answered_with_the_reason(
    client: Page, source: FormulaSource, content: str | bytes, said: str
) -> None:
    client.send(content)
    told = client.text("error")["message"]
    assert told.startswith("no credit: ")
    assert said in told
    assert "Error" not in told
    sequence = source.put(bump(1.0, 0, 0))
    client.credit()
    assert client.frame()["sequence"] == sequence


def test_a_huge_message_closes_only_its_own_connection(
    server: DashboardServer, open_page: Callable[[], Page], source: FormulaSource
) -> None:
    greedy, other = open_page(), open_page()
    greedy.send(" " * 4000)
    assert greedy.text("error")
    greedy.send(" " * 4200)
    assert greedy.is_closed()
    sequence = source.put(bump(1.0, 0, 0))
    other.credit()
    assert other.frame()["sequence"] == sequence
    assert post(server.base, b" " * 70_000)[0] == 413


def test_what_a_stage_refuses_or_lacks_is_told(server: DashboardServer, source: FormulaSource) -> None:
    source.stage.release = Mock(side_effect=InputError("the stage is stuck: oil it"))  # type: ignore[method-assign]
    assert post(server.base, RELEASE) == (409, {"message": "the stage is stuck: oil it"})
    with DashboardServer(FormulaSource(), port=0) as server:
        assert "simulated gel only" in post(server.base, RELEASE)[1]["message"]


# ---- of the wizard ----


def test_what_is_nonsense_is_refused_in_words(server: DashboardServer, calibration: Scripted) -> None:
    for body in (b"{", {"type": "jump"}, {"type": "act", "action": "explode"}, {"type": "restore", "identity": "../x"},
                 {"type": "calibrate", "request": {"ball_radius_mm": -4}},
                 {"type": "calibrate", "request": {"presses": 1}},
                 {"type": "calibrate", "request": {"pixel_size_mm": -1}},
                 {"type": "calibrate", "request": {"ball_radius_mm": 101}},
                 {"type": "act", "action": "correct", "contact_radius_px": 0}):  # fmt: skip
        status, answer = post(server.base, body)
        assert status in (400, 409)
        assert answer["message"]
    assert calibration.asked == []


def test_what_the_calibration_refuses_is_said_in_its_words(server: DashboardServer, calibration: Scripted) -> None:
    calibration.refusal = "next is not possible now: choose nothing, but wait"
    assert post(server.base, {"type": "act", "action": "next"}) == (409, {"message": calibration.refusal})


def test_another_site_can_send_nothing(server: DashboardServer, source: FormulaSource) -> None:
    assert post(server.base, {"type": "zero"}, Origin="http://evil.example")[0] == 403
    assert post(server.base, {"type": "zero"}, **{"Content-Type": "text/plain"})[0] == 415
    assert source.zeros == 0
    assert post(server.base, {"type": "zero"})[0] == 200
    assert source.zeros == 1


def test_without_a_calibration_service_everything_says_so(source: FormulaSource) -> None:
    with DashboardServer(source, port=0) as server:
        assert "no calibration" in post(server.base, {"type": "calibrate"})[1]["message"]
        assert get(server.base + "calibration")[0] == 404


def test_a_report_is_shown_without_scripts_and_a_missing_one_told(server: DashboardServer) -> None:
    _, text, headers = get(server.base + "calibration/report/" + "a" * 16)
    assert "Calibration of A17" in text
    assert headers["Content-Security-Policy"].startswith("default-src 'none'; style-src 'unsafe-inline'")
    for wrong in ("b" * 16, "..%2F..%2Fx"):
        assert get(server.base + "calibration/report/" + wrong)[0] == 404


def test_a_picture_that_is_not_there_is_told(server: DashboardServer) -> None:
    with urllib.request.urlopen(
        urllib.request.Request(server.base + "calibration/picture/live", headers=bearer())
    ) as answer:
        assert answer.read()[:2] == b"\xff\xd8"
    assert get(server.base + "calibration/picture/press")[0] == 404
