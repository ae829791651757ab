"""Slopes steeper than any press: GelNet learns what a matt surface makes of their colours.

A ball that is pressed a millimetre deep shows slopes up to some 35 degrees; the wall beside a step is steeper, and a
network that never saw such a slope answers the steepest that it saw. What a matt surface sends back of any lights is,
within a hundredth, a quadratic of its unit normal n, also where it turns away from some of them (Basri and Jacobs, IEEE
PAMI 25, 2003). So from a slope that was seen to a steeper one at the same place p the colours change by

    colour(n) - colour(n0) = sum over k of c_k(p) (f_k(n) - f_k(n0)),   f: x, y, z, x^2 - y^2, x y, x z, y z of n.

The coefficients of x, y and z are quadratics over the view, the others are the same everywhere, by least squares of
all pixels of the presses. Beside them stands what a touch changes whatever the slope, another quadratic over the view:
real gels have it, and without it z takes it for its own, which is far off beyond the presses. Of five real sensors,
learnt from the flatter six tenths of the slopes, the steeper ones have colours that are off by .22 to .35 of their
size; by Lambert's law alone, the linear part, .46 to .89.

The steepest of the pixels are tilted further, each along its own slope, so its colour goes on from what was seen.
Slopes and colours that the presses have are left to them.
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
RIDGE = 2e-6
"""times the mean square that the fit leaves, grey^2, for each pixel: coefficients are some 700 grey levels at most.
Half and twice of it are each better on some of six real sensors, by a tenth at most"""
LEAST_RIDGE = 1e-8
VIEW_TERMS = 6
"""a quadratic of the place has"""
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
    light = _light(table.chosen(pressed))
    change = (_terms(slopes, begun) - _terms(begun.gradient, begun)) @ light
    x, y = begun.pixels[:, 3:5].astype(np.intp).T
    colours = np.clip(begun.pixels[:, :3] + change, -untouched[y, x], BRIGHTEST_GREY - untouched[y, x])
    rows = np.concatenate([colours, begun.pixels[:, 3:5], slopes], axis=1, dtype=np.float32)
    seen = cKDTree(table.pixels[:: -(-len(table.rows) // MOST_COLOURS), :3])
    strange = seen.query(colours, distance_upper_bound=STRANGE_GREY)[0] > STRANGE_GREY
    return replace(begun, rows=rows).chosen(strange)


def _terms(slopes: NDArray[np.floating], table: Table) -> Array:
    """(N, 28) parts of the colours of (N, 2) slopes at the places of a table: of the touch, x, y, z, the rest of f."""
    upright = 1 / np.sqrt(1 + (slopes.astype(np.float64) ** 2).sum(axis=1))
    (x, y), z = slopes.T * upright, upright - 1
    view = over_the_view(table)
    everywhere = np.stack([x * x - y * y, x * y, x * z, y * z], axis=1)
    return np.concatenate([view, *(part[:, None] * view for part in (x, y, z)), everywhere], axis=1)


def over_the_view(table: Table) -> Array:
    """(N, 6) quadratics of the place, which runs from -1 to 1 over the picture."""
    x, y = (2 * (table.pixels[:, 3:5].astype(np.float64) + 0.5) / table.image_size - 1).T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)


def _light(table: Table) -> Array:
    """(28, 3) what each of the terms changes of each colour, trusted the less the more the fit leaves."""
    terms, colours = _terms(table.gradient, table), table.pixels[:, :3]
    square, right = terms.T @ terms / len(terms), terms.T @ colours / len(terms)
    of_touch = np.arange(terms.shape[1]) < VIEW_TERMS

    def solved(ridge: float) -> Array:
        return np.asarray(np.linalg.solve(square + np.diag(np.where(of_touch, LEAST_RIDGE, ridge)), right))

    left = float(((terms @ solved(LEAST_RIDGE) - colours) ** 2).mean())
    return solved(LEAST_RIDGE + RIDGE * left)
