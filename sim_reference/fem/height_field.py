"""The pressed object as a smooth height field: a rigid body moved along z meets the gel with its upper side alone.

The heights on the object's grid are the coefficients of a cubic B-spline: twice differentiable, nowhere above the
highest sample, so a step is a slope as wide as the grid and rings nowhere. The price is that edges are rounded by the
spline's own width, 0.6 grid steps (standard deviation), and a ball's top is lowered by step^2 / (3 radius) / 2.
"""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

Array = NDArray[np.float64]
BASIS = np.array([[[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]]) / 6
"""(1, 4, 4) the four cubic B-splines over one interval: coefficients of t^0..t^3"""


@dataclass(frozen=True, eq=False)
class Heights:
    """Height of the object and its derivatives at some points."""

    value: Array
    """(S,) mm"""
    slope: Array
    """(S, 2) d/dx, d/dy"""
    curvature: Array
    """(S, 2, 2) 1/mm"""


def with_slopes_below(heights_mm: Array, spacing_mm: float, slope: float) -> Array:
    """Return the heights (n, n) with a foot around every wall steeper than `slope`: the least that has no such wall."""
    result = heights_mm.copy()
    while True:
        before = result.copy()
        for rows, columns in ((1, 0), (0, 1), (1, 1), (1, -1)):
            fall = slope * spacing_mm * float(np.hypot(rows, columns))
            for sign in (1, -1):
                shifted = scipy.ndimage.shift(result, (sign * rows, sign * columns), order=0, mode="nearest")
                np.maximum(result, shifted - fall, out=result)
        if (result == before).all():
            return result


class HeightField:
    """z(x, y) in mm of a rigid object on a square grid about the origin; beyond the grid as at its edge."""

    def __init__(self, heights_mm: Array, spacing_mm: float) -> None:
        """Take the object's heights (n, n), rows along y."""
        self.samples, self.spacing_mm = heights_mm, spacing_mm

    def __call__(self, x: Array, y: Array) -> Array:
        """Return the height (S,) at (x, y)."""
        rows, columns, across, down = self._stencil(x, y)
        return np.asarray(np.einsum("sij,si,sj->s", self.samples[rows, columns], down[0], across[0]))

    def heights(self, x: Array, y: Array) -> Heights:
        """Return height, slope and curvature at (x, y)."""
        rows, columns, across, down = self._stencil(x, y)
        samples = self.samples[rows, columns]

        def derivative(by_x: int, by_y: int) -> Array:
            total = np.einsum("sij,si,sj->s", samples, down[by_y], across[by_x])
            return np.asarray(total / self.spacing_mm ** (by_x + by_y))

        mixed = derivative(1, 1)
        curvature = np.stack([derivative(2, 0), mixed, mixed, derivative(0, 2)], axis=1).reshape(-1, 2, 2)
        return Heights(derivative(0, 0), np.stack([derivative(1, 0), derivative(0, 1)], axis=1), curvature)

    def _place(self, at: Array) -> tuple[NDArray[np.int64], Array]:
        """Return the interval of the grid that a coordinate lies in, and where in it, 0 to 1."""
        size = len(self.samples)
        position = np.clip(at / self.spacing_mm + (size - 1) / 2, 1, size - 2 - 1e-9)
        interval = position.astype(np.int64)
        return interval, position - interval

    def _stencil(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], list[Array], list[Array]]:
        """Return rows and columns of the 4 x 4 samples around each point, and the splines' values along x and y."""
        (column, across), (row, down) = self._place(x), self._place(y)
        around = np.arange(-1, 3)
        return row[:, None, None] + around[:, None], column[:, None, None] + around, _splines(across), _splines(down)


def _splines(t: Array) -> list[Array]:
    """Return the four splines at t (S,), and their first and second derivatives: three of (S, 4)."""
    one, zero = np.ones_like(t), np.zeros_like(t)
    powers = ([one, t, t**2, t**3], [zero, one, 2 * t, 3 * t**2], [zero, zero, 2 * one, 6 * t])
    return [np.stack(power, axis=1) @ BASIS[0].T for power in powers]
