"""`gellight demo` and `gellight selfcheck` as a user runs them."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.helpers.children import gellight
from tests.helpers.command_line import invoke, refused


def test_a_bounded_demo_ends_with_its_statistics() -> None:
    run = gellight("demo", "--frames", "12", "--json", "--sensor", "sim://?object=BALL&depth=1.0&x=3&y=-2")
    assert run.returncode == 0, run.stderr
    statistics = json.loads(run.stdout.splitlines()[-1])
    assert statistics["frames"] == 12
    assert statistics["fps"] > 0
    assert 0 < statistics["frame_age_ms"]["median"] <= statistics["frame_age_ms"]["p95"]
    assert statistics["indentation_mm"] == pytest.approx(1.0, abs=0.05)
    assert statistics["selfcheck"]["passed"], statistics["selfcheck"]
    assert statistics["error"] is None
    assert re.search(r"http://127\.0\.0\.1:\d+/", run.stderr), "the address of the dashboard is printed"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--sensor", "sim://?object=CUBE&depth=1"), "'CUBE'"),
        (("--sensor", "usb://3"), "usb://"),
        (("--calibration", "nowhere"), "nowhere"),
    ],
)
def test_wrong_arguments_are_refused_by_name(arguments: tuple[str, str], words: str) -> None:
    assert words in refused(invoke("demo", "--no-browser", "--frames", "3", *arguments))


def test_pictures_of_another_size_than_the_bundle_or_without_a_truth_are_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((120, 160, 3), np.uint8))
    small = ["--no-browser", "--frames", "3", "--sensor", tmp_path]
    told = refused(invoke("demo", *small, "--calibration", "synthetic"))
    assert "160x120" in told
    assert "640x480" in told
    assert "only a simulated sensor" in refused(invoke("selfcheck", "--sensor", tmp_path))


def test_the_selfcheck_passes_on_the_shipped_calibration() -> None:
    run = gellight("selfcheck", "--json")
    assert run.returncode == 0, run.stdout + run.stderr
    report = json.loads(run.stdout)
    assert report["passed"]
    balls = [press for press in report["presses"] if press["press"].startswith("BALL 1 mm")]
    assert len(balls) == 3
    for ball in balls:
        assert ball["depth_error_mm"] <= 0.010
        assert ball["normal_error_deg"] <= 0.28
        assert ball["indentation_mm"] == pytest.approx(1.0, abs=0.03)
    assert {press["press"].split()[0] for press in report["presses"]} >= {"TSTEP", "QUCAVE", "WAVE"}
    assert set(balls[0]["bounds"]) <= set(balls[0])
