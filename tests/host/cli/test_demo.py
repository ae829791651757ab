"""`gellight demo` and `gellight selfcheck` as a user runs them."""

import json
import re
import signal
import socket
import time
from pathlib import Path
from subprocess import PIPE

import pytest

from tests.helpers.children import GELLIGHT, gellight, started


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


def test_a_port_in_use_is_named_with_the_remedy() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        run = gellight("demo", "--no-browser", "--port", str(port))
    assert run.returncode == 2
    assert f"port {port}" in run.stderr
    assert "--port" in run.stderr
    assert "Traceback" not in run.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--sensor", "sim://?object=CUBE&depth=1"), "no object 'CUBE'"),
        (("--sensor", "usb://3"), "usb://"),
        (("--calibration", "nowhere"), "nowhere does not exist"),
    ],
)
def test_wrong_arguments_are_told_in_one_line(arguments: tuple[str, str], words: str) -> None:
    run = gellight("demo", "--no-browser", "--frames", "3", *arguments)
    assert run.returncode == 2
    assert words in run.stderr
    assert "Traceback" not in run.stderr


def test_images_of_another_size_than_the_calibration_are_refused(tmp_path: Path) -> None:
    import cv2
    import numpy as np

    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((120, 160, 3), np.uint8))
    run = gellight("demo", "--no-browser", "--frames", "3", "--sensor", str(tmp_path))
    assert run.returncode == 2
    assert "160x120" in run.stderr
    assert "640x480" in run.stderr


def test_ctrl_c_ends_the_demo_quietly() -> None:
    with started([*GELLIGHT, "demo", "--no-browser", "--port", "0"], stderr=PIPE, text=True) as demo:
        assert "http://127.0.0.1:" in demo.stderr.readline()
        time.sleep(1.0)
        demo.send_signal(signal.SIGINT)
        assert demo.wait(timeout=30) == 0
        assert "Traceback" not in demo.stderr.read()


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


def test_the_selfcheck_needs_a_sensor_that_knows_the_truth(tmp_path: Path) -> None:
    import cv2
    import numpy as np

    cv2.imwrite(str(tmp_path / "frame.png"), np.zeros((480, 640, 3), np.uint8))
    run = gellight("selfcheck", "--sensor", str(tmp_path))
    assert run.returncode == 2
    assert "only a simulated sensor" in run.stderr
