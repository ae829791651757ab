"""What Prometheus and a health check are told."""

import json
import re

from gellight.dashboard.metrics import metric_lines
from gellight.dashboard.server import DashboardServer
from tests.helpers.dashboard_source import FormulaSource
from tests.helpers.page_client import get

LINE = re.compile(r'[a-z_]+(\{[a-z]+="[^"]*"\})? [-+0-9.e]+')


def test_every_figure_has_its_type_and_a_number(server: DashboardServer) -> None:
    _, text, headers = get(server.base + "metrics")
    assert headers["Content-Type"].startswith("text/plain; version=0.0.4")
    lines = text.splitlines()
    values = dict(line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
    assert [line for line in lines if not line.startswith("# ") and not LINE.fullmatch(line)] == []
    assert values["gellight_frames_total"] == "1234"
    assert values["gellight_up"] == "1"
    assert values['gellight_frame_age_seconds{quantile="0.95"}'] == "0.0178"
    assert values['gellight_stage_seconds{stage="gelnet"}'] == "0.0081"
    assert {line.split()[2] for line in lines if line.startswith("# TYPE")} == {
        line.partition("{")[0] for line in values
    }


def test_health_is_200_or_503_with_the_reason(source: FormulaSource, server: DashboardServer) -> None:
    status, text, _ = get(server.base + "health")
    assert (status, json.loads(text)) == (200, {"ok": True, "error": None})
    source.error = "reconnecting to sensor A"
    status, text, _ = get(server.base + "health")
    assert (status, json.loads(text)["error"]) == (503, "reconnecting to sensor A")


def test_the_touch_and_its_force_are_shown_where_they_are_known() -> None:
    weighed = {"touch": {"indentation_mm": 0.5, "area_mm2": 9.0, "force": {"normal_n": 1.25, "error_n": 0.1}}}
    assert {"gellight_indentation_mm 0.5", "gellight_force_newtons 1.25"} <= set(metric_lines(weighed))
    assert not [line for line in metric_lines({"touch": None}) if "force" in line or "indentation" in line]
    plain = {"touch": {**weighed["touch"], "force": None}}
    assert not [line for line in metric_lines(plain) if "force" in line]


def test_findings_are_shown_and_what_is_not_known_yet_is_left_out() -> None:
    status = {"error": "away", "frames": 0, "fps": 0.0, "frame_age_ms": {}, "watch": {"findings": [{"kind": "drift"}]}}
    lines = list(metric_lines(status))
    assert 'gellight_finding{kind="drift"} 1' in lines
    assert "gellight_up 0" in lines
    assert not [line for line in lines if "celsius" in line]
    warm = metric_lines({"ring": {"chip_c": 41.4, "ring_c": None}})
    assert [line for line in warm if line.startswith("gellight_light")] == ['gellight_light_celsius{part="chip"} 41.4']
    assert not [line for line in lines if "frame_age" in line]


def test_counters_keep_all_of_their_digits() -> None:
    for frames in (999_999, 1_000_001, 12_345_678_901):
        assert f"gellight_frames_total {frames}" in list(metric_lines({"frames": frames, "error": None}))
