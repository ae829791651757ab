"""What the camera of one real unit shows of a slope, measured on the presses that it was calibrated with.

No LED of a foreign sensor has a known place, so its light is not computed. Each labelled pixel of a press tells which
change of colour a slope made at its place. Low polynomials of the normal, whose coefficients are quadratics over the
view, are fitted to all of them by ridge regression:

    picture(p) - untouched(p) = sum over 1 <= a + b <= 4 of  nx^a ny^b  c_ab(p),   (nx, ny) = slope / sqrt(1 + slope^2)

Lambert's law is the linear part. The normal is bounded, so a wall steeper than any press is not extrapolated far; it
is taken to be as steep as the steepest pixel that was learnt from, and a place beyond the presses as the nearest one
among them. Shadows that an object casts beside itself are not in it.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle

Array = NDArray[np.float64]
Floats = NDArray[np.floating]
# Of the normal up to degree 4; measured: presses of real sensors held out are 3 to 9 grey levels off.
_POWERS = [(a, total - a) for total in range(1, 5) for a in range(total + 1)]
_PLACE_POWERS = [(a, total - a) for total in range(3) for a in range(total + 1)]  # quadratics over the view
_RIDGE = 1e-3
"""of the square of each term"""
_PIXELS = 1000
"""of a press, chosen at random: pixels beside each other are alike"""
_STEEPEST_SHARE = 0.999
"""of the pixels learnt from are less steep than what counts as the steepest"""
_COLUMNS = 7
"""of the table of a sensor with one picture of three colours: their changes, place, slopes"""


@dataclass(frozen=True, eq=False)
class MeasuredLight:
    """The picture of a gel surface of one unit."""

    reference: NDArray[np.float32]
    """(H, W, 3) grey levels of the untouched gel"""
    fields: NDArray[np.float32]
    """(14, 3, H, W) coefficient of each product of the normal's components, for each colour"""
    steepest: float
    """largest sine of the slope that was learnt from"""
    error_grey: float | None
    """mean difference from presses that were left out, in their contacts; None where there is one press alone"""

    @classmethod
    def of(cls, bundle: Bundle) -> Self:
        """Fit the presses that a bundle keeps; BundleError where it keeps none, or pictures under several lights."""
        table, (height, width) = bundle.presses(), bundle.image_shape
        rows, press = np.asarray(table["rows"], np.float64), table["image"]
        if rows.ndim != 2 or rows.shape[1] != _COLUMNS or not len(rows):
            raise BundleError(
                f"{bundle.source} was calibrated under several lights one after the other: give a bundle of single "
                "pictures of presses, as `gellight calibrate fit` writes it"
            )
        some = _some_of_each(press)
        (x, y, *slopes), changes = rows[some, 3:].T, rows[some, :3]
        normal = _normal(*slopes)
        terms = _terms(*normal, _POWERS)[:, None] * _over_the_view(x, y, (width, height))
        weights, error_grey = _fitted(terms.reshape(-1, len(some)).T, changes, press[some])
        columns, lines = (
            np.clip(np.arange(n, dtype=np.float64), at.min(), at.max()) for n, at in ((width, x), (height, y))
        )
        places = _over_the_view(columns[None, :], lines[:, None], (width, height))
        fields = np.tensordot(weights.reshape(len(_POWERS), len(_PLACE_POWERS), 3), places, axes=(1, 0))
        steepest = float(np.quantile(np.hypot(*normal), _STEEPEST_SHARE))
        return cls(bundle.reference, fields.astype(np.float32), steepest, error_grey)

    def grey(self, across: Floats, down: Floats) -> NDArray[np.float32]:
        """Return the picture before noise, (H, W, 3) grey levels, of slopes d(depth)/dx and d(depth)/dy, (H, W)."""
        nx, ny = (part.astype(np.float32) for part in _normal(across, down))
        shorter = np.minimum(1, self.steepest / np.maximum(np.hypot(nx, ny), np.float32(1e-6)))
        grey = np.moveaxis(self.reference, 2, 0).copy()
        for product, field in zip(_terms(nx * shorter, ny * shorter, _POWERS), self.fields, strict=True):
            grey += product * field
        return np.ascontiguousarray(np.moveaxis(np.maximum(grey, 0), 0, 2))


def _some_of_each(press: NDArray[np.integer]) -> NDArray[np.intp]:
    """Return the rows that are learnt from: of each press as many at most."""
    order = np.random.default_rng(0).permutation(len(press))
    return np.concatenate([order[press[order] == one][:_PIXELS] for one in np.unique(press)])


def _normal(across: Floats, down: Floats) -> tuple[Floats, Floats]:
    """Return the components along the gel of the normal; for the sign see the sum above."""
    upright = 1 / np.sqrt(1 + across**2 + down**2)
    return across * upright, down * upright


def _over_the_view(x: Floats, y: Floats, size: tuple[int, int]) -> Floats:
    """(6, ...) products of the place, which runs from -1 to 1 over (W, H) px."""
    return _terms(2 * x / size[0] - 1, 2 * y / size[1] - 1, _PLACE_POWERS)


def _terms(first: Floats, second: Floats, powers: list[tuple[int, int]]) -> Floats:
    """(K, ...) products of powers of two variables."""
    firsts, seconds = [np.ones_like(first)], [np.ones_like(second)]
    for _ in range(max(a for a, _ in powers)):
        firsts.append(firsts[-1] * first)
        seconds.append(seconds[-1] * second)
    return np.stack(np.broadcast_arrays(*(firsts[a] * seconds[b] for a, b in powers)))


def _fitted(terms: Array, changes: Array, press: NDArray[np.integer]) -> tuple[Array, float | None]:
    """Return (K, 3) weights of (N, K) terms, and the mean error on presses left out, one after the other."""
    presses = [press == one for one in np.unique(press)]
    squares = np.array([terms[own].T @ terms[own] for own in presses])
    products = np.array([terms[own].T @ changes[own] for own in presses])
    square, product = squares.sum(axis=0), products.sum(axis=0)
    penalty = np.diag(_RIDGE * np.diag(square) + 1e-9)
    if len(presses) == 1:
        return np.linalg.solve(square + penalty, product), None
    off = [
        np.abs(changes[own] - terms[own] @ np.linalg.solve(square - mine + penalty, product - made)).mean(axis=1)
        for own, mine, made in zip(presses, squares, products, strict=True)
    ]
    return np.linalg.solve(square + penalty, product), float(np.concatenate(off).mean())
