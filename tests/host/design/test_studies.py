"""`gellight optimize`: sweeps that resume, results in JSON, and bad input refused with the reason."""

import json
import logging
import os
import re
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from gellight.base.errors import ConfigError, GellightError, InputError
from gellight.cli.main import app
from gellight.design import all_studies, benchmark_files, comparison, comparison_coarse, output, report, studies
from gellight.design.all_studies import SweepTimes, time_sweep
from gellight.design.geometry import read_geometry
from gellight.design.sweep import (
    ResultStore,
    Shard,
    Study,
    SweepIncomplete,
    SweepOptions,
    Task,
    parse_shard,
    run,
    run_study,
)
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import BENCHMARK_NAMES
from sim_reference.optimizer import plain, sensitivity
from sim_reference.optimizer.coarse import CoarseResult
from sim_reference.optimizer.exposing import LightGroups

FEW = ("TSTEP", "SCROWN", "SINWAVE", "BSWAVE")


@pytest.fixture
def options(tmp_path: Path) -> SweepOptions:
    return SweepOptions(store=ResultStore(tmp_path / "store"))


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def setup(size: int = 64, names: tuple[str, ...] = FEW) -> studies.Setup:
    return replace(studies.setup_of(SensorGeometry(), 0.9, 1.0, size), names=names)


def invoke(*arguments: str) -> Any:
    result = CliRunner().invoke(app, ["optimize", *arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


calls: list[int] = []


def square(number: int) -> int:
    calls.append(number)
    if number < 0:
        raise KeyboardInterrupt
    return number**2


def tasks(*numbers: int) -> list[Task]:
    calls.clear()
    return [Task(str(number), square, (number,)) for number in numbers]


def test_an_interrupted_sweep_goes_on_where_it_stopped(options: SweepOptions) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(tasks(1, 2, -1, 3), options)
    assert calls == [1, 2, -1]
    assert run(tasks(1, 2, 3), options) == [1, 4, 9]
    assert calls == [3]


@pytest.mark.parametrize("damage", [b"", b"{}", b"[1]", b'{"key": "x", "sha256": "", "result": 5}', b"\xff\x00"])
def test_a_damaged_result_is_computed_again(
    options: SweepOptions, damage: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    (task,) = tasks(7)
    run([task], options)
    options.store.path(task.key).write_bytes(damage)
    with caplog.at_level(logging.WARNING):
        assert run([task], options) == [49]
    assert calls == [7, 7]
    assert "is damaged" in caplog.text
    assert options.store.get(task.key) == 49


def test_a_result_that_was_altered_is_computed_again(options: SweepOptions) -> None:
    (task,) = tasks(7)
    run([task], options)
    path = options.store.path(task.key)
    path.write_text(path.read_text().replace("49", "50"))
    assert run([task], options) == [49]


def test_shards_are_disjoint_and_add_up(options: SweepOptions) -> None:
    numbered = tasks(0, 1, 2, 3, 4)
    assert run(numbered, replace(options, shard=Shard(1, 2))) == [0, None, 4, None, 16]
    assert run(numbered, replace(options, shard=Shard(2, 2))) == [0, 1, 4, 9, 16]
    assert calls == [0, 2, 4, 1, 3]


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "a/b", "1/2/3", "-1/2"])
def test_a_shard_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="give i/n"):
        parse_shard(text)


def test_a_result_is_named_by_all_that_it_depends_on() -> None:
    groups = LightGroups()
    keys = {
        task.key
        for size in (64, 65)
        for noise in (1.0, 2.0)
        for task in studies.coarse_study(setup(size), replace(groups, noise_grey=noise)).tasks
    }
    assert len(keys) == 4 * len(FEW)
    again = studies.coarse_study(setup(64), groups).tasks
    assert {task.key for task in again} <= keys


def test_processes_compute_what_one_computes(options: SweepOptions, tmp_path: Path) -> None:
    groups = LightGroups(numbers=(3, 12))
    seen: list[tuple[int, int]] = []
    several = SweepOptions(
        store=ResultStore(tmp_path / "other"), workers=2, progress=lambda done, total, label: seen.append((done, total))
    )
    one, two = (run_study(studies.coarse_study(setup(), groups), how) for how in (options, several))
    assert (one.errors_rad == two.errors_rad).all()
    assert seen == [(done, 4) for done in (0, 1, 2, 3, 4)]


def test_the_timing_compares_equal_errors(options: SweepOptions) -> None:
    times = time_sweep(setup(48, FEW[:2]), replace(options, workers=2), LightGroups(numbers=(3, 6)))
    assert times.largest_difference_deg < 1e-6
    assert (times.objects, times.configurations, times.workers, times.size_px) == (2, 22, 2, 48)
    assert min(times.shared_s, times.plain_s, times.shared_cpu_s, times.plain_cpu_s) > 0


def test_the_timing_sees_a_difference(options: SweepOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    honest = plain.evaluate
    monkeypatch.setattr(plain, "evaluate", lambda pressed, groups: honest(pressed, groups) + np.radians([0, 0, 0.25]))
    times = time_sweep(setup(48, FEW[:1]), options, LightGroups(numbers=(3,), angles_rad=(0.5,)))
    assert times.largest_difference_deg == pytest.approx(0.25, abs=1e-6)


def test_the_timing_says_how_many_times_faster_the_sweep_is() -> None:
    times = SweepTimes(64, 10, 77, 2, shared_s=4, plain_s=12, shared_cpu_s=7, plain_cpu_s=11, largest_difference_deg=0)
    assert times.ratio == 3
    assert "4.0 s on 2 cores; plain NumPy, one configuration at a time: 12.0 s, 3.0 times as long" in times.in_words()


def test_the_coarse_study_writes_json_and_charts(tmp_path: Path) -> None:
    answer = invoke("coarse", "--size", "96", "--workers", "1", "--out", str(tmp_path / "out"), "--json")
    assert answer["best_angle_deg"] == 29
    assert 29 <= answer["mean_best_angle_deg"] <= 37
    assert list(answer["best_angle_by_object"]) == list(BENCHMARK_NAMES)
    assert np.shape(answer["top1_deg"]) == (7, 11)
    means = answer["map_mean_by_lights"]
    assert means["3"] > means["6"] > means["12"] == 1
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"coarse.json", "mean.svg", "TSTEP.svg"}
    assert (tmp_path / "out/TSTEP.svg").read_text().count("<rect") == 77
    again = invoke("coarse", "--size", "96", "--workers", "1", "--json")
    assert again == answer


def test_a_shard_alone_says_that_it_is_not_all(tmp_path: Path) -> None:
    answer = invoke("coarse", "--size", "32", "--workers", "1", "--shard", "2/5", "--json")
    assert answer["complete"] is False
    assert len(list(Path(answer["store"]).iterdir())) == 2


def test_the_report_takes_shards_too(tmp_path: Path) -> None:
    # The 200th task is of the last study; it is computed although those of the other studies are missing.
    answer = invoke(
        "report", "--shard", "200/300", "--workers", "1", "--size", "32", "--out", str(tmp_path / "out"), "--json"
    )
    assert answer["complete"] is False
    assert len(list(Path(answer["store"]).iterdir())) == 1
    assert not list((tmp_path / "out").iterdir())


def test_a_study_has_a_result_when_all_its_shards_are_there(options: SweepOptions) -> None:
    study = Study(tasks(3, 2, 1), sum)
    with pytest.raises(SweepIncomplete):
        run_study(study, replace(options, shard=Shard(1, 2)))
    assert calls == [3, 1]
    assert run_study(study, replace(options, shard=Shard(2, 2))) == 14
    assert run_study(replace(study, combine=list), options) == [9, 4, 1]


def test_the_fine_study_prints_json() -> None:
    answer = invoke("fine", "--size", "48", "--step", "12", "--workers", "1", "--json")
    assert answer["height_mm"] == [0, 12, 24, 36]
    assert len(answer["sat"]) == len(answer["nsd"]) == len(answer["normal_error_deg"]) == 4
    assert answer["nsd"] == sorted(answer["nsd"])
    assert answer["errors_deg"]["window"]["one exposure"]["mae"][3] is None


def test_the_ball_is_printed_as_json() -> None:
    answer = invoke("ball", "--json")
    assert answer["radius_mm"] == 4
    assert answer["elevation_deg"] == pytest.approx(60, abs=1e-9)
    assert answer["elevation_by_press_deg"]["3"][0] is None


def test_a_design_comes_with_its_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studies, "DESIGN_SAMPLING", replace(studies.DESIGN_SAMPLING, size_px=48))
    out = tmp_path / "out"
    answer = invoke("design", "--lights", "6", "--workers", "1", "--size", "64", "--out", str(out), "--json")
    assert answer["chosen"]["leds"] == 6
    assert answer["chosen"]["top1_deg"] > answer["chosen"]["mae_deg"] > 0
    files = {"design.json", "gellight.toml", "leds.csv", "ring.svg", "strip.dxf", "strip.svg"}
    assert {path.name for path in out.iterdir()} == files
    built = read_geometry(out / "gellight.toml")
    assert built.led_colours == "RRGGBB"
    assert built.mounting_height_mm == pytest.approx(answer["chosen"]["mounting_height_mm"], abs=0.06)
    assert answer["ring_colours"] == "ff0000,ff0000,00ff00,00ff00,0000ff,0000ff"
    assert answer["gains"][-1]["before_deg"] == pytest.approx(answer["given"]["top1_deg"], abs=1e-4)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["coarse", "--press", "5"], "less than the gel's 5 mm"),
        (["coarse", "--press", "-1"], "must be positive"),
        (["coarse", "--shard", "3/2"], "give i/n"),
        (["coarse", "--scheduler", "tcp://127.0.0.1:1", "--size", "32"], r"Dask|cluster"),
        (["ball", "--press", "3", "--radius", "2"], "deeper than the ball"),
        (["ball", "--press", "6"], "less than the gel's thickness"),
        (["ball", "--radius", "8"], "records 60 degrees"),
        (["ball", "--radius", "-1"], "greater than 0"),
        (["coarse", "--relief", "5"], "less than the gel's 5 mm"),
        (["design", "--lights", "2"], "multiples of 3"),
        (["design", "--lights", "3000"], "use fewer or a wider ring"),
        (["coarse", "--out", "/proc/nowhere"], "choose another --out"),
    ],
)
def test_what_is_impossible_is_refused_with_the_reason(arguments: list[str], reason: str) -> None:
    result = CliRunner().invoke(app, ["optimize", *arguments])
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
        ("mounting_height_mm = 45.0", "in or below the gel"),
        ("ring_radius_mm = 24.0", "choose ring_radius_mm up to 22.16"),
        ('led_colours = "RG"', "led_colours"),
        ("ring_radius = 20.0", "unknown key geometry.ring_radius: did you mean ring_radius_mm"),
        ("ring_radius_mm = ", "not TOML"),
    ],
)
def test_geometry_that_cannot_be_built_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "gellight.toml"
    path.write_text(f"[geometry]\n{text}\n")
    with pytest.raises(ConfigError, match=reason):
        read_geometry(path)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_geometry(tmp_path / "absent.toml")


def test_what_only_the_simulator_can_refuse_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "gellight.toml"
    path.write_text("[geometry]\nbeam_angle_deg = 0.001\n")
    result = CliRunner().invoke(
        app, ["optimize", "fine", "--geometry", str(path), "--size", "32", "--step", "18", "--workers", "1"]
    )
    assert isinstance(result.exception, InputError)
    assert "this sensor cannot be simulated: no LED lights the gel" in str(result.exception)


def die(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_worker_that_was_killed_is_reported(options: SweepOptions) -> None:
    with pytest.raises(InputError, match="use fewer --workers than 2"):
        run([Task("die", die, (1,))], replace(options, workers=2))


def test_ctrl_c_says_where_to_go_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(studies, "coarse_study", interrupted)
    result = CliRunner().invoke(app, ["optimize", "coarse", "--store", str(tmp_path / "here")])
    assert result.exit_code == 130
    assert f"what is done is kept in {tmp_path / 'here'}" in result.stderr


def test_help_says_what_is_taken_by_default() -> None:
    text = CliRunner().invoke(app, ["optimize", "coarse", "--help"], env={"COLUMNS": "160"}).stdout
    assert "[default: (the paper)]" in text
    assert "[default: 0.9]" in text


def test_a_store_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="choose another"):
        ResultStore(tmp_path / "file" / "store")
    with pytest.raises(InputError, match="choose another"):
        output.write_all(tmp_path / "file" / "out", {"x": "y"})


def test_the_solids_are_closed(tmp_path: Path) -> None:
    height, spacing = benchmark_files.benchmark_height("TSTEP", 1.0, 24)
    records = np.frombuffer(
        benchmark_files.solid_stl(np.maximum(height, -2.0), spacing)[84:], benchmark_files.STL_RECORD
    )
    corners = np.round(records["corners"].astype(float), 5)
    edges: dict[tuple[Any, Any], int] = {}
    for triangle in corners.tolist():
        points = [tuple(point) for point in triangle]
        for a, b in zip(points, points[1:] + points[:1], strict=True):
            edges[a, b] = edges.get((a, b), 0) + 1
    assert all(edges.get((b, a)) == count for (a, b), count in edges.items())
    first, second, third = corners[:, 0], corners[:, 1], corners[:, 2]
    volume = (first * np.cross(second, third)).sum() / 6
    box = (23 * spacing) ** 2
    assert volume == pytest.approx(box * 5.0, rel=0.2)
    assert volume > box * 5.0


def test_the_objects_can_be_exported(tmp_path: Path) -> None:
    written = benchmark_files.write_benchmark(tmp_path, 1.0, 32)
    assert sorted(path.name for path in written) == sorted(
        f"{name}.{kind}" for name in BENCHMARK_NAMES for kind in ("npy", "stl")
    )
    height = np.load(tmp_path / "WAVE.npy")
    assert height.shape == (32, 32)
    relief = height[height > -100]  # around the object lies nothing
    assert (relief.min(), relief.max()) == pytest.approx((-1, 0), abs=0.1)
    corners = np.frombuffer((tmp_path / "WAVE.stl").read_bytes()[84:], benchmark_files.STL_RECORD)["corners"]
    assert corners[..., 2].max() == height.max()


def test_the_report_holds_everything_and_decides_by_the_numbers(
    options: SweepOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = sensitivity.variants(SensorGeometry())[:2]
    monkeypatch.setattr(sensitivity, "variants", lambda geometry, groups: first)
    monkeypatch.setattr(studies, "DESIGN_SAMPLING", replace(studies.DESIGN_SAMPLING, size_px=32))
    six = replace(setup(48, FEW), geometry=SensorGeometry(led_colours="RRGGBB"))
    results = all_studies.run_all_studies(six, options, timed=False, numbers=(6,))
    path = report.write_report(results, tmp_path / "out")
    text = path.read_text()
    answer = report.report_json(results, path)
    assert answer["chosen"]["leds"] == 6, "as many as the given sensor has"
    assert [gain["step"] for gain in answer["gains"]] == [
        "shadowed observations dropped",
        "refraction and Fresnel losses known",
        "2 exposures of three LEDs",
        "angle, height and exposure searched together",
    ]
    assert min(gain["factor"] for gain in answer["gains"]) >= 1
    assert all(f"<td>{gain.factor:.2f}×" in text for gain in results.gains())
    assert {row["reproduced"] for row in answer["statements"]} == {True, False}
    assert all(row["why"] for row in answer["statements"] if not row["reproduced"])
    assert text.count("<svg") >= 20
    assert not re.findall(r'(?:src|href)="(?!data:)', text)
    assert text.count(comparison.summary(results.judgements())) == 2, "it is the first line, and heads the table"
    assert len(answer["statements"]) == 20
    assert all(len(row["readings"]) >= 2 for row in answer["statements"])
    assert "314.863 degrees" in text
    assert (tmp_path / "out/chosen/strip.dxf").exists()
    assert (tmp_path / "out/given/gellight.toml").exists()


def test_the_heights_stay_above_the_gel_of_a_low_camera() -> None:
    rows = comparison.saturation_table(SensorGeometry(camera_height_mm=10.0, mounting_height_mm=1.0))
    assert all(0 < row.at_20_mm < 1 for row in rows)


def test_objects_that_are_level_are_among_the_first_alike() -> None:
    errors = np.tile(np.radians(np.linspace(1, 60, 77)).reshape(1, 7, 11, 1), (10, 1, 1, 3))
    level = CoarseResult(BENCHMARK_NAMES, LightGroups(), errors)
    verdicts = {row.claim: row.reproduced for row in comparison_coarse.coarse_statements(level)}
    assert verdicts["SCROWN and SINWAVE have a large blue region"]
    assert not verdicts["a simple form with a sharp step, TSTEP, has a large error"]


def test_without_noise_the_mean_of_the_best_angles_is_the_papers(options: SweepOptions) -> None:
    groups = LightGroups(numbers=(3, 12))
    as_in_the_report = studies.setup_of(SensorGeometry(), 0.9, 1.0, 128)
    readings = run_study(studies.coarse_readings(as_in_the_report, groups), options)
    assert list(readings) == [
        "noise of 1 grey levels", "noise of 1 grey levels; CCONVEX as prisms", "no noise",
        "no noise; CCONVEX as prisms",
    ]  # fmt: skip
    assert np.degrees(readings["no noise"].mean_best_angle_rad()) == pytest.approx(32.2)
    assert np.degrees(readings["noise of 1 grey levels"].best_angle_rad()) == pytest.approx(29)
    others = [name != "CCONVEX" for name in BENCHMARK_NAMES]
    solids, prisms = (readings[name].errors_rad for name in list(readings)[2:])
    np.testing.assert_array_equal(solids[others], prisms[others])
    assert (solids != prisms).any()


def test_a_judgement_counts_the_readings_under_which_it_holds() -> None:
    def row(claim: str, *holds: bool) -> comparison.Judgement:
        one = {str(at): comparison.Statement(section="1", claim=claim, measured="", holds_if="", reproduced=hold)
               for at, hold in enumerate(holds)}  # fmt: skip
        return comparison.Judgement(one)

    rows = [row("a", True, False), row("b", False, True), row("c", False, True), row("d", False, False)]
    assert rows[1].holds_under == ["1"]
    assert comparison.summary(rows).startswith("3 of 4 statements")
    assert "2 under one and the same reading of each stage, 1 under that of the defaults" in comparison.summary(rows)


def test_a_statement_that_does_not_hold_is_not_reproduced(options: SweepOptions) -> None:
    result = run_study(studies.coarse_study(setup(48), LightGroups()), options)
    honest = {row.claim: row.reproduced for row in comparison_coarse.coarse_statements(result)}
    turned = replace(result, errors_rad=result.errors_rad[:, :, ::-1])
    other = {row.claim: row.reproduced for row in comparison_coarse.coarse_statements(turned)}
    claim = "the incident angle is 29°, closest to the average minimum"
    assert honest[claim]
    assert not other[claim]
