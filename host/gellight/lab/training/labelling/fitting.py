"""Robust least squares of a shape whose pattern is linear in unknown amounts: the amounts are eliminated.

What is left of the colours y when the best combination of the columns A is taken off is r = y - A c. While the shape
changes by dA, the best amounts c change too, so that (Golub and Pereyra, variable projection)

    dr = -P dA c - A+' dA' r,    P takes off what A explains, A+' is the transposed pseudo-inverse of A.
"""

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from typing import Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import optimize
from scipy.linalg import lapack

Array = NDArray[np.float64]
_ROBUST_GREY = 4.0
"""residuals beyond it count by their size, not its square: scratches, shadows, dust"""
_ALIKE = 3.0
_BLOCK = 64
"""columns that LAPACK works on at a time"""


@dataclass(frozen=True, kw_only=True)
class FittedShape:
    """Numbers that are fitted together."""

    def vector(self) -> Array:
        """The numbers in their order."""
        return np.array(astuple(self))

    @classmethod
    def of(cls, vector: Array) -> Self:
        """Take the numbers."""
        return cls(**dict(zip((field.name for field in fields(cls)), vector.tolist(), strict=True)))


Shape = TypeVar("Shape", bound=FittedShape)
Tried = TypeVar("Tried", bound=FittedShape, contravariant=True)


class Residual(Protocol[Tried]):
    """What a shape of P numbers leaves unexplained of N pixels."""

    def left(self, shape: Tried) -> Array:
        """(N, 3) grey levels."""

    def jacobian(self, shape: Tried) -> Array:
        """(P, 3, N) the derivative of `left` to each number of the shape."""


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Between which values each number of a shape is looked for, and in which steps."""

    low: Sequence[float]
    high: Sequence[float]
    scale: Sequence[float]
    evaluations: int
    """of the residual, at most"""


def least(residual: Residual[Shape], begin: Shape, bounds: Bounds) -> Shape:
    """Return the shape that leaves least, from one beginning inside the bounds."""
    take = type(begin).of
    found = optimize.least_squares(
        lambda vector: residual.left(take(vector)).T.ravel(),
        begin.vector(),
        jac=lambda vector: residual.jacobian(take(vector)).reshape(len(vector), -1).T,
        x_scale=bounds.scale,
        bounds=(bounds.low, bounds.high),
        loss="soft_l1",
        f_scale=_ROBUST_GREY,
        ftol=1e-6,
        max_nfev=bounds.evaluations,
    )
    return take(found.x)


def standard_errors(residual: Residual[Shape], shape: Shape, part: NDArray[np.intp]) -> Array:
    """Return the (P,) errors of a shape that `least` has found; part: (N,) number of the part of each pixel.

    What a pattern leaves unexplained is alike in neighbours, so the parts, not the pixels, count as independent (Liang
    and Zeger 1986): with the weights w of the robust loss, and sums over the pixels of a part in the middle, the
    covariance is

        (J' w J)^-1  sum_parts (J' w r)(J' w r)'  (J' w J)^-1

    and, as parts that touch are alike too, three times its standard deviations are returned.
    """
    left, jacobian = residual.left(shape), residual.jacobian(shape)
    weighted = jacobian * robust_weights(left).T
    pulls = np.einsum("pcn,nc->np", weighted, left)
    square = np.einsum("pcn,qcn->pq", weighted, jacobian)
    size = np.sqrt(np.maximum(np.diag(square), 1e-12))
    inverse = np.linalg.pinv(square / np.outer(size, size), rcond=1e-6) / np.outer(size, size)
    sums = np.zeros((int(part.max()) + 1, len(square)))
    np.add.at(sums, part, pulls)
    return np.asarray(_ALIKE * np.sqrt(((sums @ inverse) ** 2).sum(axis=0)))


def robust_weights(left: Array) -> Array:
    """Return how much each of (N, 3) residuals counts in what `least` makes least."""
    return np.asarray(1 / np.sqrt(1 + (left / _ROBUST_GREY) ** 2))


def cost(left: Array) -> float:
    """Return what `least` makes least of what is left, grey levels: squares of small values, sizes of large ones."""
    return float((np.sqrt(1 + (left / _ROBUST_GREY) ** 2) - 1).sum())


class Columns:
    """(N, M) columns, M < N, whose best combination is taken off values.

    By Householder's reflections, which are applied and never multiplied out: half the time of a fit goes in here.
    """

    def __init__(self, columns: Array) -> None:
        """Factorise the columns."""
        self._reflections, self._scales, *_ = lapack.dgeqrf(columns)
        self._count = columns.shape[1]

    def taken_off(self, values: Array) -> Array:
        """Return what is left of (N, K) values when their best combination of the columns is taken off."""
        turned = self._turned("T", values)
        turned[: self._count] = 0
        return self._turned("N", turned)

    def jacobian(self, values: Array, derivatives: Array) -> Array:
        """Return the (P, K, N) derivative of `taken_off` to each of P numbers.

        derivatives: (P, D, N) of the last D columns to each number; the other columns stay.
        """
        number, changing, pixels = derivatives.shape
        turned, upper = self._turned("T", values), self._reflections[: self._count]
        amounts, _ = lapack.dtrtrs(upper, turned[: self._count])
        turned[: self._count] = 0
        left = self._turned("N", turned)
        moved = self._turned("T", (amounts[-changing:].T @ derivatives).reshape(-1, pixels).T)
        pulled = np.zeros((self._count, moved.shape[1]))
        pulled[-changing:] = (derivatives @ left).transpose(1, 0, 2).reshape(changing, -1)
        moved[: self._count], _ = lapack.dtrtrs(upper, pulled, trans=1)
        return -self._turned("N", moved).T.reshape(number, -1, pixels)

    def _turned(self, which: str, values: Array) -> Array:
        room = _BLOCK * values.shape[1]
        turned, *_ = lapack.dormqr("L", which, self._reflections, self._scales, values, room)
        return np.asarray(turned)


class FreeResponse(Generic[Shape]):
    """What a shape leaves of colours when the response of the light to it is free."""

    def __init__(self, colour: Array, columns: Callable[[Shape], Array], derivatives: Callable[[Shape], Array]) -> None:
        """Take (N, 3) grey levels, the (N, M) pattern of a shape, and the (P, D, N) derivatives of its last D columns.

        The other columns may change with the shape as long as their combinations stay the same.
        """
        self._colour, self._pattern, self._derivatives = colour, columns, derivatives
        self._known: dict[Shape, Columns] = {}

    def left(self, shape: Shape) -> Array:
        """(N, 3) grey levels that no response of the light to this shape explains."""
        return self._columns(shape).taken_off(self._colour)

    def jacobian(self, shape: Shape) -> Array:
        """(P, 3, N) the derivative of `left` to each number of the shape."""
        return self._columns(shape).jacobian(self._colour, self._derivatives(shape))

    def _columns(self, shape: Shape) -> Columns:
        """Return the columns; the Jacobian is asked for where `left` was last."""
        if shape not in self._known:
            self._known = {shape: Columns(self._pattern(shape))}
        return self._known[shape]


def without(columns: Array, values: Array) -> Array:
    """Return what is left of (N, K) values when their best combination of (N, M) columns, M < N, is taken off."""
    return Columns(columns).taken_off(values)
