"""`gellight optimize`: results in JSON, files, and bad input refused with the reason."""

import importlib
import json
import re
import sys
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import platformdirs
import pytest

from gellight.base.errors import ConfigError, GellightError, InputError
from gellight.frames.point_cloud import STL_RECORD
from gellight_design import benchmark_files, output, studies, sweep
from gellight_design.output import write_all
from gellight_design.simulating.geometry_file import read_geometry
from gellight_design.sweep import Study, Task, kept_in, run_study
from sim_reference.objects import BENCHMARK_NAMES, ObjectParameters
from sim_reference.optimizer.exposing import LightGroups
from tests.helpers.command_line import invoke
from tests.helpers.studies import FEW, setup


def optimize(*arguments: str) -> Any:
    result = invoke("optimize", *arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_the_coarse_study_writes_json_and_charts(tmp_path: Path) -> None:
    answer = optimize("coarse", "--size", "96", "--workers", "1", "--out", str(tmp_path / "out"), "--json")
    assert answer["best_angle_deg"] == 29
    assert 29 <= answer["mean_best_angle_deg"] <= 37
    assert list(answer["best_angle_by_object"]) == list(BENCHMARK_NAMES)
    assert np.shape(answer["top1_deg"]) == (7, 11)
    means = answer["map_mean_by_lights"]
    assert means["3"] > means["6"] > means["12"] == 1
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"coarse.json", "mean.svg", "TSTEP.svg"}
    assert (tmp_path / "out/TSTEP.svg").read_text().count("<rect") == 77
    again = optimize("coarse", "--size", "96", "--workers", "1", "--json")
    assert again == answer


def test_a_study_by_finite_elements_presses_once_and_differs_from_the_layers() -> None:
    layer = replace(setup(32, ("SCROWN",)), parameters=ObjectParameters(relief_mm=0.5))
    layer = replace(layer, sampling=replace(layer.sampling, press_depth_mm=0.3))
    fem = replace(layer, gel="fem", resolution_mm=1.25)
    groups = LightGroups(numbers=(12,))
    by_layer, by_fem = (run_study(studies.coarse_study(one, groups)).errors_rad for one in (layer, fem))
    assert by_fem.shape == by_layer.shape
    assert np.abs(by_fem - by_layer).max() > radians(0.1)
    presses = list(platformdirs.user_cache_path("gellight").glob("presses/*.npz"))
    assert len(presses) == 1, "kept, so that other studies of this object read it"
    kept = presses[0].stat().st_mtime_ns
    run_study(studies.coarse_study(fem, replace(groups, noise_grey=2.0)))
    assert presses[0].stat().st_mtime_ns == kept
    assert len(list(presses[0].parent.iterdir())) == 1, "the same press serves another study"


def test_the_fine_stage_is_printed_and_drawn(tmp_path: Path) -> None:
    answer = optimize("fine", "--out", str(tmp_path), "--json")
    assert answer["mounting_height_mm"] == list(range(0, 37, 4))
    assert answer["half_saturated_mm"] == pytest.approx(9.7, abs=0.05)
    assert np.all(np.diff(answer["saturation"][:-1]) > 0)
    assert {path.name for path in tmp_path.iterdir()} == {"fine.json", "fine.svg"}
    assert invoke("optimize", "fine").stdout.endswith("SAT is 50 % at 9.7 mm\n")
    whole = optimize("fine", "--diameter-mm", "50", "--gamma", "2.2", "--json")
    assert whole["half_saturated_mm"] == pytest.approx(20.4, abs=0.05)


def test_the_ball_is_printed_as_json() -> None:
    answer = optimize("ball", "--json")
    assert answer["radius_mm"] == 4
    assert answer["elevation_deg"] == pytest.approx(60, abs=1e-9)
    assert answer["elevation_by_press_deg"]["3"][0] is None


def test_a_design_comes_with_its_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studies, "DESIGN_SAMPLING", replace(studies.DESIGN_SAMPLING, size_px=48))
    out = tmp_path / "out"
    answer = optimize("design", "--lights", "6", "--workers", "1", "--size", "64", "--out", str(out), "--json")
    assert answer["chosen"]["leds"] == 6
    assert answer["chosen"]["top1_deg"] > answer["chosen"]["mae_deg"] > 0
    assert {path.name for path in out.iterdir()} == {"design.json", "gellight.toml"}
    built = read_geometry(out / "gellight.toml")
    assert built.led_colours == "RRGGBB"
    assert built.mounting_height_mm == pytest.approx(answer["chosen"]["mounting_height_mm"], abs=0.06)
    assert answer["ring_colours"] == "ff0000,ff0000,00ff00,00ff00,0000ff,0000ff"
    assert answer["shadow_free_deg"]["given"] == pytest.approx(55.44, abs=0.01), "not 61: what the tilt of 29 leaves"
    assert answer["shadow_free_deg"]["chosen"] != answer["shadow_free_deg"]["given"]
    assert answer["given"]["leds"] == 12


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["coarse", "--press", "3.1"], "at most 3 mm, 60 % of the gel's 5 mm"),
        (["coarse", "--gel", "fem", "--resolution-mm", "0.01"], "mm fits"),
        (["coarse", "--press", "-1"], "must be positive"),
        (["ball", "--press", "3", "--radius", "2"], "deeper than the ball"),
        (["ball", "--press", "3.5"], "give 0 to 3 mm, 60% of the gel's thickness"),
        (["ball", "--press", "0"], "press deeper"),
        (["ball", "--radius", "8"], "records 60 degrees"),
        (["ball", "--radius", "-1"], "greater than 0"),
        (["coarse", "--relief", "5"], "less than the gel's 5 mm"),
        (["design", "--lights", "2"], "multiples of 3"),
        (["design", "--lights", "3000"], "use fewer or a wider ring"),
        (["coarse", "--out", "/proc/nowhere"], "choose another --out"),
    ],
)
def test_what_is_impossible_is_refused_with_the_reason(arguments: list[str], reason: str) -> None:
    result = invoke("optimize", *arguments)
    assert isinstance(result.exception, GellightError)
    assert re.search(reason, str(result.exception))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("mounting_height_mm = 36.0", "inside the gel"),
        ("mounting_height_mm = 33.0", "its acrylic of 3 mm"),
        ("camera_height_mm = 9.0", "in or below the gel"),
        ('led_colours = "RRRRRRRRRRRR"', "no LED is G or B"),
        ("ring_radius_mm = nan", "ring_radius_mm = nan is not allowed"),
        ("", "says nothing of a sensor's geometry"),
        ("ring_radius_mm = 24.0", "choose ring_radius_mm up to 22.16"),
        ('led_colours = "RG"', "led_colours"),
    ],
)
def test_geometry_that_cannot_be_built_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "gellight.toml"
    path.write_text(f"[geometry]\n{text}\n")
    with pytest.raises(ConfigError, match=reason):
        read_geometry(path, as_built=False)


def test_what_only_the_simulator_can_refuse_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "gellight.toml"
    path.write_text("[geometry]\nbeam_angle_deg = 0.001\n")
    result = invoke("optimize", "design", "--lights", "6", "--geometry", str(path), "--size", "32", "--workers", "1")
    assert isinstance(result.exception, InputError)
    assert "this sensor cannot be simulated: no LED lights the gel" in str(result.exception)


def test_ctrl_c_says_where_to_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studies.coarse, "evaluate", Mock(side_effect=KeyboardInterrupt))
    result = invoke("optimize", "coarse", "--workers", "1")
    assert result.exit_code == 130
    assert f"what is done is kept in {sweep.kept_in()}" in result.stderr


def test_the_objects_can_be_exported(tmp_path: Path) -> None:
    written = write_all(tmp_path, benchmark_files.benchmark_files(1.0, 32))
    assert sorted(path.name for path in written) == sorted(
        f"{name}.{kind}" for name in BENCHMARK_NAMES for kind in ("npy", "stl")
    )
    height = np.load(tmp_path / "WAVE.npy")
    assert height.shape == (32, 32)
    relief = height[height > -100]  # around the object lies nothing
    assert (relief.min(), relief.max()) == pytest.approx((-1, 0), abs=0.1)
    corners = np.frombuffer((tmp_path / "WAVE.stl").read_bytes()[84:], STL_RECORD)["corners"]
    assert corners[..., 2].max() == height.max()


# ---- studies go on where they stopped, and compute anew what depends on changed sources ----

calls: list[int] = []


def square(number: int) -> int:
    calls.append(number)
    if number < 0:
        raise KeyboardInterrupt
    return number**2


def squares(*numbers: int) -> Study[list[int]]:
    calls.clear()
    return Study([Task(str(number), square, (number,)) for number in numbers], list)


def test_an_interrupted_study_goes_on_where_it_stopped() -> None:
    with pytest.raises(KeyboardInterrupt):
        run_study(squares(1, 2, -1, 3))
    assert calls == [1, 2, -1]
    assert run_study(squares(1, 2, 3)) == [1, 4, 9]
    assert calls == [3]


@pytest.mark.parametrize("damage", [b"", b"[1]", b"\xff\x00"])
@pytest.mark.filterwarnings("ignore:Exception while loading")
def test_a_damaged_result_is_computed_again(damage: bytes) -> None:
    run_study(squares(7))
    (kept,) = kept_in().rglob("output.pkl")
    kept.write_bytes(damage)
    assert run_study(squares(7)) == [49]
    assert calls == [7]
    assert run_study(squares(7)) == [49]
    assert calls == []


def test_a_result_is_kept_by_all_that_it_depends_on() -> None:
    for size in (64, 65):
        for noise in (1.0, 2.0, 1.0):
            groups = LightGroups(numbers=(3,), angles_rad=(0.5,), noise_grey=noise)
            run_study(studies.coarse_study(setup(size), groups))
    assert len(list(kept_in().rglob("output.pkl"))) == 4 * len(FEW)


def test_a_mended_function_is_computed_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    found = []
    for answer in ("1.5", "2"):
        (tmp_path / "mended_study.py").write_text(f"def answer():\n    return {answer}\n")
        monkeypatch.delitem(sys.modules, "mended_study", raising=False)
        found += run_study(Study([Task("one", importlib.import_module("mended_study").answer, ())], list))
    assert found == [1.5, 2]


def test_processes_compute_what_one_computes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    study = studies.coarse_study(setup(), LightGroups(numbers=(3, 12)))
    one, seen = run_study(study), []
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    two = run_study(study, 2, lambda done, total, label: seen.append((done, total)))
    assert (one.errors_rad == two.errors_rad).all()
    assert seen == [(done, 4) for done in (0, 1, 2, 3, 4)]
    assert (run_study(replace(study, combine=list))[3] == one.errors_rad[3]).all()


def test_results_that_cannot_be_kept_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="choose another"):
        output.write_all(tmp_path / "file" / "out", {"x": "y"})
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(InputError, match="let XDG_CACHE_HOME name another folder"):
        run_study(squares(1))
