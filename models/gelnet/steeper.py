"""Slopes steeper than any press: GelNet learns what Lambert's law makes of their colours.

A ball that is pressed a millimetre deep shows slopes up to some 35 degrees; the wall beside a step is steeper, and a
network that never saw such a slope answers the steepest that it saw. What a matt surface sends back of a light is
linear in its normal. So are the colours, at each place, as long as the surface turns away from none of the lights:

    colour(n) = colour(n0) + sum over k of c_k(p) (n - n0)_k,   n the unit normal, p the place

The c_k are quadratics over the view, by least squares of all pixels of the presses. The steepest of those pixels are
tilted further, each along its own slope, so its colour goes on from what was seen. No gel is quite matt: slopes and
colours that the presses have are left to them.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gelnet.table import Table

SHARE = 0.1
"""of the pixels of the presses: as many are added; 0.3 took more from the slopes of the presses than walls gained"""
STEEPEST_RAD = 1.1
"""walls are learnt up to here; beyond, most lights are behind them"""
GENTLE_SHARE, LEARNT_SHARE = 0.5, 0.95
"""of the pixels of the presses: as many are too flat to begin a wall with; as many are less steep than what is added"""
STRANGE_GREY = 8.0
"""grey levels from the nearest colour of the presses: nearer it is theirs"""
MOST_COLOURS = 20_000
"""of the presses, evenly chosen: more change nothing"""
RIDGE = 1e-3
"""of the square of each term"""
BRIGHTEST_GREY = 255.0
Array = NDArray[np.float64]


def steeper_rows(table: Table, untouched: NDArray[np.float32], random: np.random.Generator) -> Table:
    """Return rows of slopes between the steepest of a table of three colours and `STEEPEST_RAD`.

    untouched: (H, W, 3) picture of the gel at rest, grey levels: no colour gets darker than black or brighter than
    white. None are returned where nothing slopes, or all is as steep.
    """
    inclined = np.arctan(np.hypot(*table.gradient.T))
    pressed = np.flatnonzero(inclined > 0)
    if not len(pressed):
        return table.chosen(pressed)
    gentle, learnt = np.quantile(inclined[pressed], [GENTLE_SHARE, LEARNT_SHARE])
    if learnt >= STEEPEST_RAD:
        return table.chosen(pressed[:0])
    of = random.choice(pressed[inclined[pressed] >= gentle], round(SHARE * len(pressed)))
    begun, wall = table.chosen(of), random.uniform(learnt, STEEPEST_RAD, len(of))
    slopes = begun.gradient * (np.tan(wall) / np.tan(inclined[of]))[:, None]
    turned = _normals(slopes) - _normals(begun.gradient)
    light = _light(table.chosen(pressed))
    change = np.einsum("nk,nj,kjc->nc", turned, _over_the_view(begun), light)
    x, y = begun.pixels[:, 3:5].astype(np.intp).T
    colours = np.clip(begun.pixels[:, :3] + change, -untouched[y, x], BRIGHTEST_GREY - untouched[y, x])
    rows = np.concatenate([colours, begun.pixels[:, 3:5], slopes], axis=1, dtype=np.float32)
    seen = cKDTree(table.pixels[:: -(-len(table.rows) // MOST_COLOURS), :3])
    strange = seen.query(colours, distance_upper_bound=STRANGE_GREY)[0] > STRANGE_GREY
    return replace(begun, rows=rows).chosen(strange)


def _normals(slopes: NDArray[np.floating]) -> Array:
    """(N, 3) x and y of the unit normal, and by how much its z is less than 1."""
    upright = 1 / np.sqrt(1 + (slopes.astype(np.float64) ** 2).sum(axis=1))
    return np.stack([slopes[:, 0] * upright, slopes[:, 1] * upright, upright - 1], axis=1)


def _over_the_view(table: Table) -> Array:
    """(N, 6) quadratics of the place, which runs from -1 to 1 over the picture."""
    x, y = (2 * (table.pixels[:, 3:5].astype(np.float64) + 0.5) / table.image_size - 1).T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)


def _light(table: Table) -> Array:
    """(3, 6, 3) what each part of the normal changes of each colour, as a quadratic over the view."""
    terms = (_normals(table.gradient)[:, :, None] * _over_the_view(table)[:, None, :]).reshape(len(table.rows), -1)
    square = terms.T @ terms
    penalty = np.diag(RIDGE * np.diag(square) + 1e-9)
    return np.asarray(np.linalg.solve(square + penalty, terms.T @ table.pixels[:, :3]).reshape(3, 6, 3))
