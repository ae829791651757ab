"""Commands of the page: what reaches the stage, and what happens to nonsense."""

import json
from collections.abc import Callable
from unittest.mock import Mock

import pytest

from gellight.base.errors import InputError
from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import HEIGHT, PIXEL_MM, WIDTH, FormulaSource, bump
from tests.helpers.page_client import Page, pages
from tests.helpers.scripted_calibration import Scripted
from tests.helpers.waiting import eventually

PRESS = {"type": "press", "object": "BALL", "depth_mm": 0.5, "x_mm": 0.0, "y_mm": 0.0}
HALF_VIEW_MM = (WIDTH * PIXEL_MM / 2, HEIGHT * PIXEL_MM / 2)


def test_press_and_release_reach_the_stage(page: Page, source: FormulaSource) -> None:
    page.credit()
    source.put(bump(1.0, 0, 0))
    page.frame()
    press = {"type": "press", "object": "WAVE", "depth_mm": 0.75, "x_mm": -3, "y_mm": 4.5}
    assert page.answer(**press) == {"type": "done", "command": "press"}
    assert page.answer(type="release") == {"type": "done", "command": "release"}
    assert source.stage.calls == [("WAVE", 0.75, -3.0, 4.5), None]


def test_a_running_calibration_is_in_the_status_and_nobody_else_may_press(
    calibration: Scripted, page: Page, source: FormulaSource
) -> None:
    calibration.calibrating = True
    page.credit()
    source.put(bump(1.0, 0, 0))
    page.frame()
    assert page.text("status")["calibrating"] is True
    for command in (PRESS, {"type": "release"}):
        assert "a calibration is running" in page.answer(**command)["message"]
    calibration.calibrating = False
    assert page.answer(**PRESS)["type"] == "done"
    while page.text("status")["calibrating"]:
        pass
    assert source.stage.calls == [("BALL", 0.5, 0.0, 0.0)]


def begin_a_press(page: Page, source: FormulaSource) -> None:
    """Send a press and wait until the stage computes it, which goes on until it `may_prepare`."""
    stage = source.stage
    page.credit(8)
    source.put(bump(1.0, 0, 0))
    page.frame()
    stage.may_prepare.clear()
    page.send(**PRESS)
    eventually(lambda: stage.prepared)


def test_a_press_is_computed_before_it_is_made_and_stops_neither_frames_nor_status(
    page: Page, source: FormulaSource
) -> None:
    stage = source.stage
    begin_a_press(page, source)
    sequence = source.put(bump(1.0, 0, 0))
    assert page.frame()["sequence"] == sequence
    first = page.text("status")
    assert page.text("status")["now_s"] > first["now_s"]
    assert stage.calls == []
    stage.may_prepare.set()
    assert page.text("done", "error")["type"] == "done"
    assert stage.calls == [("BALL", 0.5, 0.0, 0.0)]


def test_an_object_that_is_released_while_it_is_computed_is_not_pressed(page: Page, source: FormulaSource) -> None:
    stage = source.stage
    begin_a_press(page, source)
    assert page.answer(type="release") == {"type": "done", "command": "release"}
    stage.may_prepare.set()
    assert page.text("done", "error") == {"type": "done", "command": "press"}
    assert stage.calls == [None]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "the command is no JSON"),
        ("[]", "is not allowed: give an object"),
        ("{}", "the command has no type"),
        ('{"type": "explode"}', "explode"),
        (json.dumps(PRESS | {"object": "HAND"}), "no object 'HAND': choose one of BALL"),
        (json.dumps(PRESS | {"depth_mm": -0.1}), "depth_mm = -0.1 is not allowed: give a number at least 0"),
        (json.dumps(PRESS | {"depth_mm": 2.01}), "depth_mm = 2.01 is too deep: choose 0 to 2"),
        (json.dumps(PRESS | {"depth_mm": float("nan")}), "depth_mm = nan is not allowed: give a finite number"),
        (json.dumps(PRESS | {"x_mm": float("inf")}), "x_mm = inf is not allowed: give a finite number"),
        (json.dumps(PRESS | {"x_mm": HALF_VIEW_MM[0] + 0.01}), "x_mm = 18.826 is outside the view"),
        (json.dumps(PRESS | {"y_mm": -HALF_VIEW_MM[1] - 0.01}), "y_mm = -14.122 is outside the view"),
        (json.dumps(PRESS | {"y_mm": "0"}), "y_mm = '0' is not allowed: give a number"),
        (json.dumps(PRESS | {"force": 1}), "force is unknown: leave it out"),
        ('{"type": "press"}', "object is missing"),
        ('{"type": "credit", "count": 0}', "count = 0 is not allowed: give a number at least 1"),
        ('{"type": "credit", "count": 1e99}', "is not allowed: give a whole number"),
    ],
)
def test_a_bad_command_is_answered_and_harms_nothing(page: Page, source: FormulaSource, text: str, said: str) -> None:
    page.credit()
    source.put(bump(1.0, 0, 0))
    page.frame()
    page.send(text)
    assert said in page.text("done", "error")["message"]
    assert page.answer(**PRESS)["type"] == "done"
    assert source.stage.calls == [("BALL", 0.5, 0.0, 0.0)]


def test_binary_commands_are_answered_with_an_error(page: Page) -> None:
    page.send(b"\0\1")
    assert "not binary" in page.text("error")["message"]


def test_a_huge_command_closes_only_its_own_connection(open_page: Callable[[], Page]) -> None:
    greedy, other = open_page(), open_page()
    greedy.send(" " * 4000)
    assert greedy.text("error")
    greedy.send(" " * 4200)
    assert greedy.is_closed()
    assert other.answer(type="release")["type"] == "done"


def test_a_press_before_the_first_frame_is_answered(page: Page) -> None:
    assert "no frame has been seen yet" in page.answer(**PRESS)["message"]


def test_what_the_stage_refuses_is_told(page: Page, source: FormulaSource) -> None:
    source.stage.release = Mock(side_effect=InputError("the stage is stuck: oil it"))  # type: ignore[method-assign]
    answer = page.answer(type="release")
    assert answer == {"type": "error", "command": "release", "message": "the stage is stuck: oil it"}


def test_a_sensor_without_stage_says_so() -> None:
    with DashboardServer(FormulaSource(), port=0) as server, pages() as connect:
        page = connect(server.base)
        assert page.text("status")["stage"] is None
        assert "no stage" in page.answer(type="release")["message"]
