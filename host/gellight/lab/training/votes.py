"""Which labels of the same presses are better, without taking either of them for the truth.

On a ball the sine of the slope is linear in the place: sin x = (c - p) / R for the pixel p, the centre c and the radius
R. So each pixel of a press votes for a centre,

    c = p + R sin x,

and where slopes are right all votes of a press agree, whoever drew its circle. The slopes come from a polynomial in
closed form that learnt from all other presses, under the labels that are judged, in pixels that lie inside the circles
of every label. So centres are judged, and no radius: who leaves the rim out always agrees better.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.training.polynomial import powers_up_to, terms_of
from gellight.lab.training.presses import Ball, Floats, Press, distance_px
from gellight.reconstruction.light_drift import difference_of

Array = NDArray[np.float64]
_DARKEST = 20.0
"""grey levels below which a ratio says nothing"""
_COLOUR_DEGREE, _PLACE_DEGREE = 3, 2
_POWERS = [
    powers
    for powers in powers_up_to(_COLOUR_DEGREE + _PLACE_DEGREE, 5)
    if 1 <= sum(powers[:3]) <= _COLOUR_DEGREE and sum(powers[3:]) <= _PLACE_DEGREE
]
_GREY = 60.0
_RIDGE = 1e-3
SIDE = 25
"""pixels along the diameter of a contact that are looked at"""
SURE = 0.8
"""of a contact radius: so far the ball touches the gel under each of the labels"""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """Pixels of one press."""

    places: Array
    """(n, 2) px"""
    terms: Array
    """(n, K)"""
    distances: Array
    """(labels, n) from the centre, in contact radii, under each label"""


def votes_apart_deg(
    labels: Sequence[Sequence[Press]], reference: Floats, ball: Ball, *, follow_light: bool
) -> NDArray[np.float64]:
    """Return how far apart the votes for the centre of each press are under each of several labels, (labels, presses).

    labels: the same presses in the same order. It is the mean distance from their median, as an angle of the ball,
    degrees, over pixels that are sure under every label. Raises InputError for fewer than two presses.
    """
    if len(labels[0]) < 2:
        raise InputError(f"{len(labels[0])} press: labels are judged on presses held out, give at least two")
    bright = np.maximum(reference, _DARKEST)
    gain = np.asarray(bright / bright.mean(), np.float32)  # ratios keep the size of grey levels
    seen = [_seen(same, reference, gain, follow_light) for same in zip(*labels, strict=True)]
    return np.array([_of_one(one, seen, ball) for one in labels])


def _seen(same: Sequence[Press], reference: Floats, gain: Floats, follow_light: bool) -> _Seen:
    """Look at the pixels of one press, under all of its labels."""
    change = difference_of(same[0].picture(), reference, follow_light=follow_light)
    height, width = shape = change.shape[0], change.shape[1]
    distances = np.stack([distance_px(press, shape) / press.contact_radius_px for press in same])
    step = max(1, round(2 * same[0].contact_radius_px / SIDE))
    near: NDArray[np.bool_] = np.any(distances < 1, axis=0)
    if (hidden := same[0].hidden()) is not None:
        near &= ~hidden
    some = np.zeros_like(near)
    some[::step, ::step] = near[::step, ::step]
    rows, columns = np.nonzero(some)
    colours = (change / gain)[rows, columns] / _GREY
    return _Seen(
        places=np.stack([columns, rows], axis=1).astype(np.float64),
        terms=terms_of([*colours.T, 2 * columns / width - 1, 2 * rows / height - 1], _POWERS),
        distances=distances[:, rows, columns],
    )


def _of_one(labels: Sequence[Press], seen: Sequence[_Seen], ball: Ball) -> Array:
    """(presses,) how far the votes are apart under these labels."""
    sums = [_sums(press, one, ball) for press, one in zip(labels, seen, strict=True)]
    squares, products = (np.array([of[i] for of in sums]) for i in (0, 1))
    square, product = squares.sum(axis=0), products.sum(axis=0)
    apart = []
    for one, own_square, own_product in zip(seen, squares, products, strict=True):
        others = square - own_square
        penalty = np.diag(_RIDGE * np.diag(others) + 1e-12)
        weights = np.linalg.solve(others + penalty, product - own_product)
        sure = (one.distances < SURE).all(axis=0)
        votes = one.places[sure] + ball.radius_px * (one.terms[sure] @ weights)
        off = np.linalg.norm(votes - np.median(votes, axis=0), axis=1)
        apart.append(float(np.degrees(off.mean() / ball.radius_px)))
    return np.array(apart)


def _sums(press: Press, seen: _Seen, ball: Ball) -> tuple[Array, Array]:
    """Normal equations of the pixels of one press that lie inside under every label; each press has the same weight."""
    inside = (seen.distances < 1).all(axis=0)
    terms = seen.terms[inside]
    sine = ((press.center_x_px, press.center_y_px) - seen.places[inside]) / ball.radius_px
    return terms.T @ terms / len(terms), terms.T @ sine / len(terms)
