"""What a few presses say of places where nothing was pressed: GelNet learns its answers beside the labelled pixels.

A cubic in the colours, whose terms may change slowly over the gel, answers the angle of the slope. It has a closed form
and holds from one press on, where a network alone takes the place of the presses for what makes the colours. Its prior
says that the light is even but for what the untouched picture shows: each further degree of the colour costs `COLOUR`
times more, of the place `PLACE` times more, and the more presses there are the less any of it costs.

Presses of a unit like this one, where there are some, are fitted first: the prior then is their answer, and each term
costs by how far it is from theirs. A unit that is none shows itself: on the presses of this one its answers are off by
more than `UNLIKE` times what no slope at all is off.

The three figures of the prior were chosen on presses of four real sensors. Chosen on three of them, and judged on the
fourth, they came out the same to a step of the grid (3 times), at every number of presses from 1 to all.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gelnet.parameters import PLACE as PLACE_NAMES
from gelnet.parameters import Floats
from gelnet.table import Table

RIDGE = 0.02
"""of the linear terms of the colour, for one press: against mean squares of angles, rad^2"""
LIKE_RIDGE = 0.5
"""the same, against the answers of a like unit"""
UNLIKE = 0.5
COLOUR, PLACE = 3.0, 3.0
COLOUR_DEGREE, PLACE_DEGREE = 3, 2
STEEPEST_RAD = 1.3
DARKEST_GREY = 20.0
"""grey levels below which a ratio to the untouched picture says nothing"""
MOST_ROWS = 3000
"""of a press, evenly chosen: more change nothing"""
NEAR = 1.5
"""times the reach of a press: nearer, what was pressed says more than the teacher"""
WORTH = 5
"""presses: the teacher's rows are as many as these have, and no more, for it knows less than many presses"""
REST_SHARE = 0.3
REST_SPREAD = 0.02
"""of the root mean square of the colours: as far an untouched pixel may change by noise"""
_BLOCK = 20_000
Array = NDArray[np.float64]


def _powers(degree: int, variables: int) -> NDArray[np.intp]:
    """(K, variables) powers of all terms of at most this degree, the constant first."""
    every = product(range(degree + 1), repeat=variables)
    return np.array(sorted((powers for powers in every if sum(powers) <= degree), key=sum))


_COLOURS = _powers(COLOUR_DEGREE, 3)[1:]  # no change of colour is no slope, everywhere
_PLACES = _powers(PLACE_DEGREE, len(PLACE_NAMES))
_COSTS = np.outer(COLOUR ** (_COLOURS.sum(axis=1) - 1.0), PLACE ** _PLACES.sum(axis=1)).ravel()


@dataclass(frozen=True, kw_only=True, eq=False)
class Teacher:
    """Slopes from colour and place, as few presses allow."""

    gain: Floats
    """(H, W, 3) untouched picture over its mean: colours are divided by it"""
    least: Array
    """(3,) smallest and"""
    most: Array
    """(3,) largest colours of the presses: others are clipped to this range"""
    weights: Array
    """(K, 2) of the terms"""

    @property
    def unit(self) -> float:
        """What the colours are counted in."""
        return float(np.sqrt((self.least**2 + self.most**2).mean()))

    def answer(self, pixels: Floats) -> Floats:
        """Return the (N, 2) slopes of (N, 5) pixels: change of colour in grey levels, x, y in px."""
        blocks = [pixels[start : start + _BLOCK] for start in range(0, len(pixels), _BLOCK)]
        angles = np.concatenate([_terms(_even(block, self.gain), block, self) @ self.weights for block in blocks])
        return np.asarray(np.tan(np.clip(angles, -STEEPEST_RAD, STEEPEST_RAD)), np.float32)


def fit_teacher(table: Table, untouched: Floats) -> Teacher:
    """Fit to the rows that slope of a table of three colours; untouched: (H, W, 3) grey levels.

    Minimises the mean over the presses of |terms w - atan(slope)|^2, plus cost |w - w0|^2 / number of presses, w0 being
    the weights of a like unit, or 0.
    """
    bright = np.maximum(untouched, DARKEST_GREY)
    gain = np.asarray(bright / bright.mean(axis=(0, 1)), np.float32)
    chosen, share, presses = of_presses(table)
    pixels, angles = table.pixels[chosen], np.arctan(table.gradient[chosen])
    colours = _even(pixels, gain)
    like = fit_teacher(table.like, untouched) if table.like else None
    least, most = colours.min(axis=0), colours.max(axis=0)
    if like:
        least, most = np.minimum(least, like.least), np.maximum(most, like.most)
    fitted = Teacher(gain=gain, least=least, most=most, weights=np.zeros((0, 2)))
    terms = _terms(colours, pixels, fitted)
    # Terms of the place cost as the colour term has it that they are multiplied with.
    size = np.repeat((share * terms[:, :: len(_PLACES)] ** 2).sum(axis=0), len(_PLACES))
    cost = (LIKE_RIDGE if like else RIDGE) / presses * _COSTS * size
    begun = _weights_in(like, fitted) if like else np.zeros((terms.shape[1], 2))
    square = terms.T @ (share * terms) + np.diag(cost)
    weights = np.linalg.solve(square, terms.T @ (share * angles) + cost[:, None] * begun)
    return replace(fitted, weights=weights)


def unlikeness(table: Table, untouched: Floats) -> float:
    """Return how far the answers of the like unit are off on the presses of a table, over what no slope is off."""
    if table.like is None:
        raise ValueError("the table has no presses of a like unit")
    chosen, share, _ = of_presses(table)
    true = np.arctan(table.gradient[chosen])
    off = np.arctan(fit_teacher(table.like, untouched).answer(table.pixels[chosen])) - true
    return float((share[:, 0] * np.hypot(*off.T)).sum() / (share[:, 0] * np.hypot(*true.T)).sum())


def of_presses(table: Table) -> tuple[NDArray[np.intp], Array, int]:
    """Return the rows of presses that are fitted, (n, 1) how much each counts, and the number of presses."""
    pressed = (table.gradient != 0).any(axis=1)
    presses = [np.flatnonzero(pressed & (table.image == number)) for number in np.unique(table.image[pressed])]
    presses = [rows[:: -(-len(rows) // MOST_ROWS)] for rows in presses]
    share = np.concatenate([np.full(len(rows), 1 / len(rows) / len(presses)) for rows in presses])
    return np.concatenate(presses), share[:, None], len(presses)


def _weights_in(like: Teacher, fitted: Teacher) -> Array:
    """Return the weights of a teacher for terms in the unit of another: a term is as many units as it has degrees."""
    ratio = fitted.unit / like.unit
    scale = np.repeat(ratio ** _COLOURS.sum(axis=1).astype(np.float64), len(_PLACES))
    return np.asarray(like.weights * scale[:, None])


def with_taught(table: Table, untouched: Floats, random: np.random.Generator) -> Table:
    """Return the table with more rows, at random places that are not near a press.

    As many as `WORTH` presses have, and no more than there are, have the colours of the presses and the slopes that
    `Teacher` answers; 0.3 times as many as there are are of a gel at rest. With a like unit, which has more to teach,
    there may be more than there are, half of them with its colours.
    """
    colours, width = table.pixels[:, :3], np.array(table.image_size) - 1
    worth = WORTH / len(np.unique(table.image))
    count = round(len(colours) * (worth if table.like else min(worth, 1)))
    of = random.integers(0, len(colours), count + round(REST_SHARE * max(count, len(colours))))
    taught, rest = colours[of[:count]], len(of) - count
    if table.like:
        taught[1::2] = table.like.pixels[random.integers(0, len(table.like.rows), count // 2), :3]
    noise = REST_SPREAD * float(np.sqrt((colours**2).mean())) * random.standard_normal((rest, 3))
    places = random.integers(0, width + 1, (len(of), 2))
    pixels = np.concatenate([np.concatenate([taught, noise]), places], axis=1, dtype=np.float32)
    slopes = np.zeros((len(of), 2), np.float32)
    slopes[:count] = fit_teacher(table, untouched).answer(pixels[:count])
    new, numbers = np.concatenate([pixels, slopes], axis=1), table.image[of]
    far = _far_from_presses(table, pixels[:, 3:5])
    return table.joined(replace(table, rows=new[far], image=numbers[far]))


def _far_from_presses(table: Table, places: Floats) -> NDArray[np.bool_]:
    """(N,) whether the (N, 2) places are farther from each press than `NEAR` times its pixels reach."""
    far, pressed = np.ones(len(places), np.bool_), (table.gradient != 0).any(axis=1)
    for number in np.unique(table.image[pressed]):
        own = table.pixels[pressed & (table.image == number), 3:5]
        centre = own.mean(axis=0)
        reach = np.linalg.norm(own - centre, axis=1).max()
        far &= np.linalg.norm(places - centre, axis=1) > NEAR * reach
    return far


def _even(pixels: Floats, gain: Floats) -> Array:
    """(N, 3) colours as they would be under even light."""
    x, y = (pixels[:, column].astype(np.intp) for column in (3, 4))
    return np.asarray(pixels[:, :3] / gain[y, x], np.float64)


def _terms(colours: Array, pixels: Floats, teacher: Teacher) -> Array:
    """(N, K) products of powers of the (N, 3) colours and of the place, which is -1 to 1 over the picture."""
    height, width = teacher.gain.shape[:2]
    place = 2 * (pixels[:, 3:5] + 0.5) / (width, height) - 1
    of_colour = _product(np.clip(colours, teacher.least, teacher.most) / teacher.unit, _COLOURS)
    return np.asarray((of_colour[:, :, None] * _product(place, _PLACES)[:, None, :]).reshape(len(pixels), -1))


def _product(values: NDArray[np.floating], powers: NDArray[np.intp]) -> Array:
    """(N, K) products of the columns of (N, V) values, each to its power of (K, V)."""
    columns = [np.power.outer(column, np.arange(powers.max() + 1)) for column in values.T.astype(np.float64)]
    return np.asarray(np.prod([column[:, power] for column, power in zip(columns, powers.T, strict=True)], axis=0))
