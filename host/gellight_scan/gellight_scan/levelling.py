"""How high each press of a scan lies, how it is tilted, and how all of them are bent.

Height and tilt are found once more from all that overlaps: the map has a step nowhere that a shift or a tilt could take
away. Integration bends each press a little, all presses of a sensor alike. What is bent to a paraboloid differs between
two presses by a plane, so overlaps tell nothing of it; the cubic terms differ by a paraboloid, which overlaps tell.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FEWEST_PX = 200
"""in common, for two presses to be levelled by"""
OUTLIER = 3.0
"""times the usual difference"""
ROUNDS = 3
PLANE, BEND = 3, 4
"""number of terms: a press's own, and those that all have in common"""
SPAN_MM = 15.0
"""from the middle of a press, where a bend is stated"""
MOST_BENT_MM = 0.03
"""standard deviation of a cubic term at that place, before anything is known"""
ALIKE_MM = 2.0
"""over such a length the errors of a press are alike: so many pixels count as one"""


@dataclass(frozen=True, eq=False)
class Laid:
    """A press on the grid of the part."""

    rows: slice
    columns: slice
    height_mm: Array
    """(h, w) of this window; NaN where the gel did not reach"""
    error_mm: Array
    fade: Array
    """(h, w) from 1 down to 0 at the border of the view, also where the gel did not reach; 0 beyond"""
    place_mm: Array
    """(h, w, 2) x and y in the press, from its middle"""


def overlaps(laid: list[Laid]) -> Iterator[tuple[int, int, tuple[slice, slice], Array, Array]]:
    """Yield two presses, the window that they share, the difference of their heights in it and its variance."""
    for i, j in combinations(range(len(laid)), 2):
        window = tuple(
            slice(max(a.start, b.start), min(a.stop, b.stop))
            for a, b in ((laid[i].rows, laid[j].rows), (laid[i].columns, laid[j].columns))
        )
        if all(side.start < side.stop for side in window):
            one, other = (
                [plane[_within(each, (window[0], window[1]))] for plane in (each.height_mm, each.error_mm)]
                for each in (laid[i], laid[j])
            )
            yield i, j, (window[0], window[1]), one[0] - other[0], one[1] ** 2 + other[1] ** 2


def _within(one: Laid, window: tuple[slice, slice]) -> tuple[slice, slice]:
    """Return a window of the grid as a window of a press."""
    rows, columns = (
        slice(side.start - own.start, side.stop - own.start)
        for side, own in zip(window, (one.rows, one.columns), strict=True)
    )
    return rows, columns


def levelled(x_mm: Array, y_mm: Array, laid: list[Laid]) -> list[Laid]:
    """Return the presses as they agree best, shifted, tilted and all bent alike; as a whole they are not tilted.

    x_mm, y_mm: the columns and rows of the grid that they are laid on.
    """
    size = PLANE * len(laid) + BEND
    matrix, right = np.zeros((size, size)), np.zeros(size)
    matrix[-BEND:, -BEND:] = np.eye(BEND) * ALIKE_MM**2 / abs(x_mm[1] - x_mm[0]) ** 2 / MOST_BENT_MM**2
    for i, j, (rows, columns), difference, variance in overlaps(laid):
        known = np.isfinite(difference)
        if np.count_nonzero(known) < FEWEST_PX:
            continue
        x, y = np.meshgrid(x_mm[columns], y_mm[rows])
        bend = [_bend(laid[each].place_mm[_within(laid[each], (rows, columns))][known]) for each in (i, j)]
        basis = np.column_stack([np.ones(np.count_nonzero(known)), x[known], y[known], bend[0] - bend[1]])
        weighted, pull = _fitted(basis, difference[known], variance[known])
        parts = np.zeros((PLANE + BEND, size))
        parts[:PLANE, PLANE * i : PLANE * (i + 1)] = np.eye(PLANE)
        parts[:PLANE, PLANE * j : PLANE * (j + 1)] = -np.eye(PLANE)
        parts[PLANE:, -BEND:] = np.eye(BEND)
        matrix += parts.T @ weighted @ parts
        right -= parts.T @ pull
    found = np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-12)[0], np.float64)
    planes = found[:-BEND].reshape(-1, PLANE)
    return [_put_right(one, plane, found[-BEND:], x_mm, y_mm) for one, plane in zip(laid, planes, strict=True)]


def _bend(place_mm: Array) -> Array:
    """Return the (..., 4) cubic terms of places (..., 2) in a press."""
    x, y = place_mm[..., 0] / SPAN_MM, place_mm[..., 1] / SPAN_MM
    return np.stack([x**3, x**2 * y, x * y**2, y**3], axis=-1)


def _fitted(basis: Array, difference: Array, variance: Array) -> tuple[Array, Array]:
    """Return what (N,) differences say of the factors of a basis (N, K): weight (K, K) and pull (K,), robustly."""
    weight = 1 / variance
    for _ in range(ROUNDS):
        weighted = basis.T @ (basis * weight[:, None])
        pull = basis.T @ (weight * difference)
        off = np.abs(difference - basis @ np.linalg.lstsq(weighted, pull, rcond=None)[0])
        weight = 1 / variance / np.maximum(off / (OUTLIER * 1.48 * np.median(off) + 1e-9), 1)
    return basis.T @ (basis * weight[:, None]), basis.T @ (weight * difference)


def _put_right(one: Laid, plane: Array, bend: Array, x_mm: Array, y_mm: Array) -> Laid:
    x, y = x_mm[one.columns][None, :], y_mm[one.rows][:, None]
    return replace(one, height_mm=one.height_mm + plane[0] + plane[1] * x + plane[2] * y + _bend(one.place_mm) @ bend)
