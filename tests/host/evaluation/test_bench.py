"""The bench: its surfaces are what they say, its figures are measured, its tables hold them."""

import itertools
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from gellight.cli.bench import command
from gellight.evaluation import bench
from gellight.evaluation.analytic_surfaces import Surface, fitted_scale, gaussian, plane, sharp_cap, smooth_cap
from gellight.evaluation.bench import Times, depth_scales, frame_times
from gellight.reconstruction import stages
from gellight.reconstruction.stages import STAGES
from tests.helpers.linear_sensor import linear_bundle, tanh_network

app = typer.Typer()
app.command()(command)


@pytest.mark.parametrize(
    "make",
    [
        lambda x, y: gaussian((50, 60), 6, (x, y), 3),
        lambda x, y: smooth_cap((50, 60), 30, (x, y), 3),
        lambda x, y: sharp_cap((50, 60), 30, (x, y)),
    ],
)
def test_the_slopes_of_the_surfaces_are_the_derivatives_of_their_depth(make: object) -> None:
    step = 1e-4

    def at(x: float, y: float) -> Surface:
        return make(1.3 + x, -2.2 + y)  # type: ignore[operator,no-any-return]

    by_x = (at(-step, 0).depth - at(step, 0).depth) / (2 * step)
    by_y = (at(0, -step).depth - at(0, step).depth) / (2 * step)
    assert np.abs(np.stack([by_x, by_y], axis=2) - at(0, 0).gradient_map).max() < 1e-6


def test_a_plane_and_the_fitted_scale() -> None:
    tilted = plane((5, 7), 0.5, 2.0)
    assert np.allclose(np.diff(tilted.depth, axis=1), 0.5)
    assert np.allclose(np.diff(tilted.depth, axis=0), 2.0)
    assert tilted.depth[2, 3] == 0
    assert fitted_scale(3 * tilted.depth + 7, tilted.depth) == pytest.approx(3)


def test_frame_times_are_of_all_stages_and_both_scenes(tmp_path: Path) -> None:
    bundle = linear_bundle(tmp_path / "b", (240, 320), network=tanh_network(16))
    partly, fully = frame_times(bundle, rounds=3)
    assert partly.touched == pytest.approx(0.15, abs=0.02)
    assert fully.touched == 1
    for times in (partly, fully):
        assert tuple(times.stages) == STAGES
        assert (times.image_width_px, times.image_height_px) == (320, 240)


def test_ratios_are_of_the_plain_network_to_its_stages_and_to_the_whole_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = linear_bundle(tmp_path / "b", (48, 64), network=tanh_network(8))
    clock = SimpleNamespace(perf_counter=itertools.count(0, 1e-3).__next__)  # every look at it takes a millisecond
    monkeypatch.setattr(bench, "time", clock)
    monkeypatch.setattr(stages, "time", clock)
    for times in frame_times(bundle, rounds=3):
        assert set(times.stages.values()) == {Times(1.0, 1.0)}
        # The clock is looked at when the frame begins, after each stage, and when it has ended.
        assert times.whole == Times(len(STAGES) + 2.0, len(STAGES) + 2.0)
        assert times.plain == Times(1.0, 1.0)
        assert times.plain_over_slopes == pytest.approx(1 / 2)
        assert times.plain_over_whole == pytest.approx(1 / (len(STAGES) + 2))


@pytest.fixture(scope="module")
def scales() -> list[dict[str, object]]:
    result = CliRunner().invoke(app, ["integrator", "--json"])
    assert result.exception is None
    rows: list[dict[str, object]] = json.loads(result.stdout)
    return rows


def test_the_integrator_table_keeps_what_the_readme_says(scales: list[dict[str, object]]) -> None:
    assert len(scales) == 2 * (5 * 2 * 3 + 1)
    for row in scales:
        if row["surface"] in ("gaussian", "plane"):
            assert row["scale"] == pytest.approx(1, abs=0.001), row
        elif row["surface"] == "smooth cap" and float(str(row["size_px"])) >= 10:
            assert row["scale"] == pytest.approx(1, abs=0.005), row
    assert max(float(str(r["largest_error"])) for r in scales if r["surface"] == "plane") < 1e-5


def test_sharp_rims_scatter_and_the_table_says_so(scales: list[dict[str, object]]) -> None:
    spreads = {r["size_px"]: float(str(r["scale_spread"])) for r in scales if r["surface"] == "sharp cap"}
    assert spreads[5] > 0.03
    assert spreads[60] < 0.01


def test_the_tables_are_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    linear_bundle(tmp_path / "b", (48, 64), network=tanh_network(8))
    result = CliRunner().invoke(app, ["--calibration", str(tmp_path / "b"), "--rounds", "3"])
    assert result.exception is None
    for word in (*STAGES, "15 % touched", "all touched", "plain one-batch network", "x the whole frame"):
        assert word in result.stdout
    rows = json.loads(CliRunner().invoke(app, ["--calibration", str(tmp_path / "b"), "--rounds", "3", "--json"]).stdout)
    assert rows[0]["stages"]["depth"]["minimum_ms"] > 0
    monkeypatch.setattr(bench, "depth_scales", lambda: depth_scales()[:1])
    monkeypatch.setattr(bench, "_SHAPES", ((40, 50),))
    monkeypatch.setattr(bench, "_SIZES_PX", (10,))
    assert "gaussian" in CliRunner().invoke(app, ["integrator"]).stdout
