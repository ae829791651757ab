"""The bench: its surfaces are what they say, its figures are measured, its tables hold them."""

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from gellight.bundle.bundle import Bundle
from gellight.cli.bench import command
from gellight.lab.evaluation import bench
from gellight.lab.evaluation.analytic_surfaces import Surface, fitted_scale, gaussian, plane, sharp_cap, smooth_cap
from gellight.lab.evaluation.bench import depth_scales
from gellight.lab.evaluation.synthetic import SimulatedError, evaluate_simulated

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


def test_presses_are_measured_at_three_depths(monkeypatch: pytest.MonkeyPatch) -> None:
    measured: dict[float, SimulatedError] = {}

    def once(bundle: Bundle, *, depth_mm: float) -> SimulatedError:
        if depth_mm not in measured:
            measured[depth_mm] = evaluate_simulated(bundle, presses=1, depth_mm=depth_mm)
        return measured[depth_mm]

    monkeypatch.setattr("gellight.cli.bench.evaluate_simulated", once)
    rows = json.loads(CliRunner().invoke(app, ["presses", "--json"]).stdout)
    assert [row["press_depth_mm"] for row in rows] == [1, 1.5, 2]
    assert all(0 < row["contact_normal_mae_deg"] < 1 for row in rows)
    assert rows[0]["contact_normal_mae_deg"] < rows[2]["contact_normal_mae_deg"], "the deeper, the steeper"
    table = CliRunner().invoke(app, ["presses"]).stdout.splitlines()
    assert table[0].split() == ["press_depth_mm", "1", "1.5", "2"]
    assert len(table) == len(rows[0])


def test_the_table_is_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "depth_scales", lambda: depth_scales()[:1])
    monkeypatch.setattr(bench, "_SHAPES", ((40, 50),))
    monkeypatch.setattr(bench, "_SIZES_PX", (10,))
    assert "gaussian" in CliRunner().invoke(app, ["integrator"]).stdout
