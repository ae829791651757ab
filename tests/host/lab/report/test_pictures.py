"""Pictures of maps as files and in pages."""

import pytest

from gellight.lab.report.pictures import round_step


@pytest.mark.parametrize(
    ("span", "most", "step"), [(1000, 10, 100), (100, 6, 20), (0.03, 6, 0.005), (7, 6, 2), (1, 10, 0.1), (500, 10, 50)]
)
def test_steps_are_round(span: float, most: int, step: float) -> None:
    assert round_step(span, most) == pytest.approx(step)
