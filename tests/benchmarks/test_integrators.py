"""The integrator on surfaces that are what they say they are."""

import numpy as np
import pytest

from tests.benchmarks.integrators import DepthScale, depth_scales
from tests.helpers.analytic_surfaces import Surface, fitted_scale, gaussian, plane, sharp_cap, smooth_cap


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
def scales() -> list[DepthScale]:
    return depth_scales()


def test_the_integrator_keeps_what_the_documents_say(scales: list[DepthScale]) -> None:
    assert len(scales) == 2 * (5 * 2 * 3 + 1)
    for row in scales:
        if row.surface in ("gaussian", "plane"):
            assert row.scale == pytest.approx(1, abs=0.001), row
        elif row.surface == "smooth cap" and row.size_px >= 10:
            assert row.scale == pytest.approx(1, abs=0.005), row
    assert max(row.largest_error for row in scales if row.surface == "plane") < 1e-5


def test_sharp_rims_scatter_and_the_table_says_so(scales: list[DepthScale]) -> None:
    spreads = {row.size_px: row.scale_spread for row in scales if row.surface == "sharp cap"}
    assert spreads[5] > 0.03
    assert spreads[60] < 0.01
