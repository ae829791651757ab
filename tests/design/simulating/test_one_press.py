"""One press, computed and kept."""

import json
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.point_cloud import solid_stl
from gellight_design.simulating.one_press import PressRequest, object_heights, press_once
from sim_reference.geometry import SensorGeometry
from tests.helpers.command_line import invoke, refused

GEOMETRY = SensorGeometry()
BALL = PressRequest(object_name="ball", depth_mm=0.4, force_n=None, gel="fem", resolution_mm=1.25, friction=0.0)


def test_the_verb_writes_surface_and_report(tmp_path: Path) -> None:
    command = ["simulate", "press", "--object", "ball", "--depth-mm", "0.4", "--resolution-mm", "1.25", "--json"]
    result = invoke(*command, "--out", str(tmp_path / "p"))
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["depth_mm"] == pytest.approx(0.4, abs=1e-3)
    assert 0.05 < report["force_n"] < 1.0
    assert report["min_gap_mm"] > 0
    assert report["min_det_f"] > 0
    assert report["vertices"] > 1000
    assert report["newton_steps"] > 3
    with np.load(tmp_path / "p/press.npz") as written:
        force = written["pressure_mpa"].sum() * written["spacing_mm"] ** 2
        assert force == pytest.approx(report["force_n"], rel=1e-5)
        assert written["tangential_mm"].shape == (512, 512, 2)
    assert json.loads((tmp_path / "p/report.json").read_text()) == report
    again = invoke(*command, "--out", str(tmp_path / "p"))
    assert "exists" in refused(again)


@pytest.mark.parametrize("gel", [pytest.param("fem", marks=pytest.mark.nightly), "layer"])
def test_a_force_presses_as_deep_as_it_takes(tmp_path: Path, gel: str) -> None:
    request = PressRequest(**{**BALL.__dict__, "depth_mm": None, "force_n": 0.3, "gel": gel})
    report = press_once(request, tmp_path, GEOMETRY, lambda _: None)
    assert report.force_n == pytest.approx(0.3, rel=1e-5 if gel == "layer" else 5e-3)
    assert 0.3 < report.depth_mm < 0.8


def test_a_solid_from_a_file_is_an_object(tmp_path: Path) -> None:
    at = np.linspace(-3, 3, 25)
    cone = -np.hypot(at[None, :], at[:, None])
    (tmp_path / "cone.stl").write_bytes(solid_stl(cone, 0.25, float(cone.min()) - 5))
    height = object_heights(str(tmp_path / "cone.stl"))
    assert height.max() == pytest.approx(0, abs=0.1)
    assert height[256, 256 + 16] == pytest.approx(-2.06, abs=0.1)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (["--object", "cube", "--depth-mm", "1"], "choose one of BALL, TSTEP"),
        (["--object", "nowhere.stl", "--depth-mm", "1"], "cannot be read"),
        (["--object", "models/cup.step", "--depth-mm", "1"], "models/cup.step is not a .stl file"),
        (["--object", "ball", "--depth-mm", "3.5"], "above 0 to 3 mm"),
        (["--object", "ball", "--depth-mm", "1", "--force-n", "1"], "one of the two"),
        (["--object", "ball"], "one of the two"),
        (["--object", "ball", "--force-n", "1000"], "above 0 to"),
        (["--object", "ball", "--depth-mm", "1", "--friction", "0.5", "--gel", "layer"], "give --gel fem"),
        (["--object", "ball", "--depth-mm", "1", "--resolution-mm", "0.01"], "mm fits"),
        (["--object", "ball", "--depth-mm", "1", "--resolution-mm", "7"], "2.5 mm"),
    ],
)
def test_what_cannot_be_pressed_is_refused_with_what_works(tmp_path: Path, given: list[str], reason: str) -> None:
    result = invoke("simulate", "press", *given, "--out", str(tmp_path / "new/p"))
    assert result.exit_code != 0
    assert isinstance(result.exception, InputError)
    assert reason in str(result.exception)
    assert "takes" not in result.stderr, "nobody waits for what was refused"
    assert not (tmp_path / "new").exists()
