"""The integrator on surfaces that are what they say they are."""

import pytest

from tests.benchmarks.integrators import DepthScale, depth_scales


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
