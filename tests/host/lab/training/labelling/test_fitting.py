"""How well a fitted shape is known."""

from dataclasses import dataclass

import numpy as np

from gellight.lab.training.labelling.fitting import Array, FittedShape, standard_errors


@dataclass(frozen=True, kw_only=True)
class Line(FittedShape):
    offset: float
    rise: float


class LineResidual:
    """What a straight line leaves of values, the same in each channel."""

    def __init__(self, x: Array, values: Array) -> None:
        self._x, self._values = x, values

    def left(self, shape: Line) -> Array:
        return self._values - (shape.offset + shape.rise * self._x)[:, None]

    def jacobian(self, shape: Line) -> Array:
        return -np.stack([np.ones((3, len(self._x))), np.tile(self._x, (3, 1))])


def test_the_errors_are_three_times_those_of_least_squares_and_more_where_the_pixels_of_a_part_are_alike() -> None:
    random, x, parts = np.random.default_rng(0), np.linspace(-1, 1, 4000), np.arange(4000) // 50
    exact = 3 * 0.1 * np.sqrt([1.0, 3.0]) / (3 * 4000) ** 0.5  # the mean of x^2 is 1 / 3
    alone = LineResidual(x, random.normal(0, 0.1, (4000, 3)))
    found = standard_errors(alone, Line(offset=0.0, rise=0.0), np.arange(4000))
    np.testing.assert_allclose(found, exact, rtol=0.05)
    shared = LineResidual(x, np.repeat(random.normal(0, 0.1, (80, 3)), 50, axis=0))
    found = standard_errors(shared, Line(offset=0.0, rise=0.0), parts)
    np.testing.assert_allclose(found, 50**0.5 * exact, rtol=0.2)
