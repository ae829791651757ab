"""Equations 5 and 8 at their limits."""

import numpy as np
import pytest

from sim_reference.metrics import maximum_elevation, mean_of_largest


@pytest.mark.parametrize("share", [0.0, 1.0, float("nan")])
def test_a_share_outside_0_to_1_is_refused(share: float) -> None:
    with pytest.raises(ValueError, match="share"):
        mean_of_largest([1.0], share)


@pytest.mark.parametrize(("radius", "degrees"), [(2.5, 78.463), (3, 70.529), (4, 60), (5, 53.130), (8, 41.410)])
def test_a_smaller_ball_records_steeper_slopes(radius: float, degrees: float) -> None:
    assert np.degrees(maximum_elevation(radius, 2.0)) == pytest.approx(degrees, abs=1e-3)


def test_equation_8_is_the_arc_tangent_of_the_paper() -> None:
    edge = np.sqrt(4.0**2 - (4.0 - 1.3) ** 2)
    assert maximum_elevation(4.0, 1.3) == pytest.approx(np.arctan(edge / (4.0 - 1.3)))


@pytest.mark.parametrize("depth", [0.0, -1.0, 4.1, float("nan")])
def test_a_ball_cannot_be_pressed_beyond_its_equator(depth: float) -> None:
    with pytest.raises(ValueError, match="radius"):
        maximum_elevation(4.0, depth)
