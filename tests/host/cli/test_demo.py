"""`gellight demo` as a user runs it, and the host against the reference simulator."""

import json
import re
import sys

import pytest

from tests.helpers.children import gellight, run
from tests.helpers.places import CHECKOUT


def test_a_bounded_demo_ends_with_its_statistics() -> None:
    done = gellight("demo", "--frames", "12", "--json", "--sensor", "sim://?object=BALL&depth=1.0&x=3&y=-2", check=True)
    statistics = json.loads(done.stdout.splitlines()[-1])
    assert statistics["frames"] == 12
    assert statistics["fps"] > 0
    assert 0 < statistics["frame_age_ms"]["median"] <= statistics["frame_age_ms"]["p95"]
    assert statistics["indentation_mm"] == pytest.approx(1.0, abs=0.05)
    assert statistics["error"] is None
    assert re.search(r"http://127\.0\.0\.1:\d+/", done.stderr), "the address of the dashboard is printed"


def test_the_selfcheck_passes_on_the_shipped_calibration() -> None:
    done = run([sys.executable, "-m", "tests.benchmarks.selfcheck"], cwd=CHECKOUT)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = {
        tuple(words[:6]): [float(word) for word in words[6:12]]
        for words in map(str.split, done.stdout.splitlines()[1:])
    }
    balls = [figures for press, figures in rows.items() if press[:2] == ("BALL", "1")]
    assert len(balls) == 3
    for depth_mm, normal_deg, _, _, _, felt_mm in balls:
        assert depth_mm <= 0.010
        assert normal_deg <= 0.28
        assert felt_mm == pytest.approx(1.0, abs=0.03)
    assert {press[0] for press in rows} >= {"TSTEP", "QUCAVE", "WAVE"}
