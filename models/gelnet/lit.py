"""What known lights make of every slope in every place: GelNet learns it beside the labelled pixels.

The host measures the light of each LED on the untouched gel, and works out what a matt surface would show: of the
slopes of the presses, and of slopes of all directions all over the view. What a real gel shows otherwise is fitted to
the presses, as a field over the view of quadratics of the unit normal (as in `steeper`), with a prior that says that
there is none of it: each degree of the normal and of the place costs `DEGREE` times more, and the more presses there
are the less any of it costs. Half of the presses judge what the other half adds: it is taken where it is clearly
better, for labels that are a pixel off add something too. Lights that are not those of the presses show themselves so.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelnet.steeper import BRIGHTEST_GREY, over_the_view
from gelnet.table import Table
from gelnet.teacher import of_presses

RIDGE = 0.02
"""of the linear terms of the normal, for one press, as a share of their mean square: that of `teacher`"""
DEGREE = 3.0
MOST_OFF = 0.25
"""of the colours of presses that nothing was fitted to, rms: beyond it the presses teach alone. Six real single lights
leave .27 to .28: their rows made balls held out better in one draw and worse in another"""
CLEARLY = 0.9
_PLACE_COSTS = DEGREE ** np.array([0.0, 1, 1, 2, 2, 2])
_COSTS = np.outer(DEGREE ** np.array([0.0, 0, 0, 1, 1, 1, 1]), _PLACE_COSTS).ravel()
Array = NDArray[np.float64]


class Lights(NamedTuple):
    """How far the lights of a table show what its presses show."""

    off: float
    """on half of the presses, after what the other half adds to the lights: rms, as a share of that of the colours"""
    corrected: bool
    """whether the presses add something: it brings `off` to `CLEARLY` of what the lights alone are off"""

    @property
    def believed(self) -> bool:
        """Whether they are learnt from."""
        return self.off <= MOST_OFF

    def record(self) -> dict[str, object]:
        """Return the figures for training.json."""
        return {"off": round(self.off, 3), "corrected": self.corrected, "learnt_from": self.believed}


def judged(table: Table) -> Lights:
    """Compare the lights of a table with its presses; of one press, the lights alone."""
    pressed = _pressed(table)
    presses, left = np.unique(pressed.image), _left(pressed)
    seen = max(float((pressed.pixels[:, :3] ** 2).sum()), 1.0)  # of a picture that never changes 0
    alone, with_presses = float((left**2).sum()), 0.0
    if len(presses) < 2:
        return Lights(math.sqrt(alone / seen), corrected=False)
    terms = _terms(pressed)
    for judges in (presses[::2], presses[1::2]):
        judging = np.isin(pressed.image, judges)
        weights = _weights(terms[~judging], left[~judging], len(presses) - len(judges))
        with_presses += float(((left[judging] - terms[judging] @ weights) ** 2).sum())
    corrected = with_presses < CLEARLY**2 * alone
    return Lights(math.sqrt((with_presses if corrected else alone) / seen), corrected)


def lit_rows(table: Table, *, corrected: bool) -> Table:
    """Return the rows of the lights of a table of three colours, corrected: with what its presses show otherwise.

    The presses of a like unit, where there are some, tell it too.
    """
    assert table.lit_rows is not None
    assert table.untouched is not None
    new = replace(table, rows=table.lit_rows, image=np.resize(table.image, len(table.lit_rows)), lit=None)
    x, y = new.pixels[:, 3:5].astype(np.intp).T
    rest, rows = table.untouched[y, x], table.lit_rows.copy()
    added = _terms(new) @ _added(table) if corrected else 0.0
    rows[:, :3] = np.clip(rows[:, :3] + added, -rest, BRIGHTEST_GREY - rest)
    return replace(new, rows=rows)


def _added(table: Table) -> Array:
    """(42, 3) what the presses add to the lights."""
    pressed = _pressed(table)
    if table.like:
        like = _pressed(table.like)
        pressed = pressed.joined(replace(like, image=like.image + 1 + pressed.image.max()))
    return _weights(_terms(pressed), _left(pressed), len(np.unique(pressed.image)))


def _pressed(table: Table) -> Table:
    """Return the rows of the presses that the teacher is fitted to."""
    return table.chosen(of_presses(table)[0])


def _left(pressed: Table) -> NDArray[np.float32]:
    """(N, 3) what the lights leave of the colours."""
    assert pressed.lit is not None
    return pressed.pixels[:, :3] - pressed.lit


def _weights(terms: Array, left: NDArray[np.float32], presses: int) -> Array:
    """(42, 3) what the terms make of what is left of the colours."""
    square = terms.T @ terms
    cost = RIDGE / presses * _COSTS * np.repeat(np.diag(square)[:: len(_PLACE_COSTS)], len(_PLACE_COSTS))
    return np.asarray(np.linalg.solve(square + np.diag(cost), terms.T @ left))


def _terms(table: Table) -> Array:
    """(N, 42) x, y, z - 1, x^2 - y^2, x y, x z, y z of the unit normal, each times a quadratic over the view."""
    slopes = table.gradient.astype(np.float64)
    upright = 1 / np.sqrt(1 + (slopes**2).sum(axis=1))
    (x, y), z = slopes.T * upright, upright
    of_normal = np.stack([x, y, z - 1, x * x - y * y, x * y, x * z - x, y * z - y], axis=1)
    return np.asarray((of_normal[:, :, None] * over_the_view(table)[:, None, :]).reshape(len(slopes), -1))
