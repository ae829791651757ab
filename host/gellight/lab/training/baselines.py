"""Two other ways from colour to slope, fitted to the same table: what GelNet has to beat, and a second opinion.

The look-up table is figure 3b of the paper (and how GelSight sensors are calibrated elsewhere): the mean slope of each
cell of colour change, blind to the place. The polynomial has a closed form and needs a second: it is what a network
must beat to be worth its training.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.base.errors import InputError
from gellight.lab.training.polynomial import powers_up_to, ridge, terms_of
from gellight.lab.training.table import PressTable

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
_CELL_GREY = 6.0
_CELLS = 64
"""a side: from -192 to 192 grey levels"""
_COLOUR_DEGREE, _PLACE_DEGREE, _DEGREE = 4, 2, 5
_POWERS = [
    powers
    for powers in powers_up_to(_DEGREE, 5)
    if 1 <= sum(powers[:3]) <= _COLOUR_DEGREE and sum(powers[3:]) <= _PLACE_DEGREE
]
"""of the three colour changes, at least one of them, and the two places"""
_RIDGE = 1e-3
_FITTED_ROWS = 60_000
_STEEPEST = 0.97
"""largest sine of the slope that the polynomial may answer: 76 degrees"""
_GREY = 60.0
_DARKEST = 20.0
"""grey levels below which a ratio says nothing"""


class Baseline(Protocol):
    """A map from difference image to slopes."""

    def gradient_map(self, difference: Floats) -> Floats:
        """Return (H, W, 2) d(depth)/dx, d(depth)/dy of a (H, W, 3) difference image, grey levels."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LookupTable:
    """Slopes by colour change alone."""

    slopes: Floats
    """(64, 64, 64, 2) mean slope of each cell; that of the nearest filled cell where nothing was seen"""

    def gradient_map(self, difference: Floats) -> Floats:
        """Look each pixel up."""
        red, green, blue = np.moveaxis(_cells(difference), -1, 0)
        return np.asarray(self.slopes[red, green, blue])


def fit_lookup_table(table: PressTable) -> LookupTable:
    """Average the slopes in each cell of colour change of a table."""
    cells = _cells(table.rows[:, :3])
    flat = np.ravel_multi_index(tuple(cells.T), (_CELLS,) * 3)
    count = np.bincount(flat, minlength=_CELLS**3)
    sums = [np.bincount(flat, weights=table.rows[:, column], minlength=_CELLS**3) for column in (5, 6)]
    mean = np.stack(sums, axis=1) / np.maximum(count, 1)[:, None]
    empty = (count == 0).reshape((_CELLS,) * 3)
    nearest = ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
    return LookupTable(slopes=mean.reshape(_CELLS, _CELLS, _CELLS, 2)[tuple(nearest)].astype(np.float32))


def _cells(difference: Floats) -> NDArray[np.intp]:
    cells = np.floor(difference / _CELL_GREY).astype(np.intp) + _CELLS // 2
    return np.asarray(np.clip(cells, 0, _CELLS - 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Polynomial:
    """The normal as a polynomial of colour change and place; no colour change is flat, everywhere."""

    weights: Array
    """(K, 2) of the terms, for the sine of the slope along x and y"""
    least: Array
    """(3,) smallest and"""
    most: Array
    """(3,) largest inputs it was fitted to: others are clipped to this range"""
    gain: Floats | None
    """(H, W, 3) what the difference is divided by, for ratio features; None: nothing"""

    def gradient_map(self, difference: Floats) -> Floats:
        """Evaluate every pixel."""
        height, width = difference.shape[:2]
        y, x = (axis.ravel() for axis in np.indices((height, width), dtype=np.float64))
        colour = (difference if self.gain is None else difference / self.gain).reshape(-1, 3)
        sine = np.zeros((height * width, 2))
        for part in np.array_split(np.arange(height * width), max(1, height * width // 20_000)):
            terms = _terms(np.clip(colour[part], self.least, self.most), x[part], y[part], (width, height))
            sine[part] = terms @ self.weights
        return _slopes(sine).reshape(height, width, 2)


def fit_polynomial(table: PressTable, *, reference: Floats | None = None) -> Polynomial:
    """Fit by ridge regression in closed form.

    With the (H, W, 3) reference, grey levels, the inputs are ratios: the difference over the reference, which dimming
    LEDs leave as they are.
    """
    rows = table.rows
    if len(rows) > _FITTED_ROWS:
        rows = rows[np.random.default_rng(0).choice(len(rows), _FITTED_ROWS, replace=False)]
    gain = None if reference is None else ratio_gain(reference)
    colour, slopes = rows[:, :3].astype(np.float64), rows[:, 5:].astype(np.float64)
    if gain is not None:
        colour /= gain[rows[:, 4].astype(np.intp), rows[:, 3].astype(np.intp)]
    terms = _terms(colour, rows[:, 3], rows[:, 4], table.image_size)
    scale = np.sqrt((terms**2).mean(axis=0))
    if not scale.all():
        raise InputError("the colours of the presses never change in one channel: check the light")
    terms /= scale
    sine = slopes / np.sqrt(1 + (slopes**2).sum(axis=1, keepdims=True))
    weights = ridge(terms, sine, _RIDGE) / scale[:, None]
    return Polynomial(weights=weights, least=colour.min(axis=0), most=colour.max(axis=0), gain=gain)


def ratio_gain(reference: Floats) -> Floats:
    """(H, W, 3) reference over its mean, so that ratios keep the size of grey levels."""
    bright = np.maximum(reference, _DARKEST)
    return np.asarray(bright / bright.mean(), np.float32)


def _terms(colour: NDArray[np.floating], x: Array | Floats, y: Array | Floats, size: tuple[int, int]) -> Array:
    """(N, K) products of powers of colour change (at least one) and place."""
    width, height = size
    return terms_of([*(colour / _GREY).T, 2 * x / width - 1, 2 * y / height - 1], _POWERS)


def _slopes(sine: Array) -> Floats:
    """Turn (N, 2) sines into slopes, shortened where they are too steep."""
    length = np.hypot(sine[:, 0], sine[:, 1])
    sine = sine * np.minimum(1, _STEEPEST / np.maximum(length, 1e-12))[:, None]
    slopes: Floats = (sine / np.sqrt(1 - (sine**2).sum(axis=1, keepdims=True))).astype(np.float32)
    return slopes
