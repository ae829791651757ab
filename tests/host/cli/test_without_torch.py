"""Every verb that trains works where PyTorch is not installed, as after `make demo`."""

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.lab.report.pictures import write_png
from tests.helpers.children import gellight, run

pytestmark = pytest.mark.nightly

SMALL = (
    '[sensor]\nurl = "sim://?fps=500&board=0"\n[geometry]\nimage_width_px = 320\nimage_height_px = 240\n'
    "pixel_size_mm = 0.1176\n"
)


NO_TORCH = """import importlib.machinery
search = importlib.machinery.PathFinder.find_spec
importlib.machinery.PathFinder.find_spec = lambda name, path=None, target=None: (
    None if name.partition(".")[0] == "torch" else search(name, path, target))
"""
"""None in `sys.modules` would do, but SciPy looks there for a module"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment in which this Python, and every Python that it starts, finds no torch."""
    place = tmp_path_factory.mktemp("without torch")
    (place / "sitecustomize.py").write_text(NO_TORCH)
    path = os.pathsep.join([str(place), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path, "XDG_DATA_HOME": str(place), "XDG_CONFIG_HOME": str(place)}


@pytest.fixture(scope="module")
def calibrated(environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A calibration by the virtual hand, and what it printed."""
    folder = tmp_path_factory.mktemp("calibrated")
    (folder / "gellight.toml").write_text(SMALL)
    few = ["--presses", "10", "--verifications", "2", "--recipe", "fast"]
    done = gellight("calibrate", "--auto", "--out", "mine", *few, "--json", cwd=folder, env=environment)
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_there_is_no_torch_in_this_environment(environment: dict[str, str]) -> None:
    done = run([sys.executable, "-c", "import torch"], env=environment)
    assert done.returncode == 1
    assert "ModuleNotFoundError" in done.stderr


def test_the_routine_runs_to_its_end_and_says_what_trained(calibrated: tuple[Path, dict[str, Any]]) -> None:
    folder, printed = calibrated
    assert printed["verdict"]["passed"]
    trained = printed["figures"]["fit"]["training"]
    assert trained["trainer"] == f"numpy {np.__version__}"
    bundle = load_bundle(folder / "mine")
    assert bundle.metrics["training"]["trainer"] == trained["trainer"]
    assert f"by {trained['trainer']}" in (folder / "mine/report.html").read_text()
    session = onnxruntime.InferenceSession(bundle.network, providers=["CPUExecutionProvider"])
    assert session.get_modelmeta().custom_metadata_map["schema"] == "gelnet/1"


def test_recorded_presses_can_be_trained_on(
    calibrated: tuple[Path, dict[str, Any]], environment: dict[str, str]
) -> None:
    state = calibrated[0] / "mine.state"
    presses = json.loads((state / "state.json").read_text())["presses"]
    columns = ("center_x_px", "center_y_px", "contact_radius_px")
    lines = [",".join([press["file"], *(str(press[name]) for name in columns)]) for press in presses]
    (state / "presses.csv").write_text("\n".join([",".join(["image", *columns]), *lines]) + "\n")
    write_png(state / "untouched.png", np.load(state / "reference.npy").round().astype(np.uint8))
    given = ["--presses", "presses.csv", "--reference", "untouched.png", "--ball-radius-mm", "4"]
    how = ["--pixel-size-mm", "0.1176", "--recipe", "fast", "--epochs", "2", "--width", "8"]
    more = ["--out", "fitted", "--largest-normal-error-deg", "90", "--folds", "2"]
    done = gellight("calibrate", "fit", *given, *how, *more, "--json", cwd=state, env=environment)
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert figures["metrics"]["training"]["trainer"].startswith("numpy ")
    assert figures["metrics"]["cross_validation"]["normal_error_deg"]["mean"] < 45


def test_doctor_says_what_trains(environment: dict[str, str], tmp_path: Path) -> None:
    done = gellight("doctor", "--json", cwd=tmp_path, env=environment)
    findings = {finding["check"]: finding for finding in json.loads(done.stdout)["findings"]}
    assert findings["training"]["level"] == "ok"
    assert findings["training"]["text"] == f"numpy {np.__version__} trains networks"
