"""What the server of the calibration wizard takes and refuses."""

import urllib.request

from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.page_client import bearer, get, post
from tests.helpers.scripted_calibration import Scripted


def test_what_is_nonsense_is_refused_in_words(server: DashboardServer, calibration: Scripted) -> None:
    for body in (b"{", {"type": "jump"}, {"type": "act", "action": "explode"}, {"type": "restore", "identity": "../x"},
                 {"type": "calibrate", "request": {"ball_radius_mm": -4}},
                 {"type": "calibrate", "request": {"presses": 1}},
                 {"type": "calibrate", "request": {"pin_pitch_mm": -1}},
                 {"type": "calibrate", "request": {"ball_radius_mm": 51}},
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
