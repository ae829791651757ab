"""The terms of polynomials of several variables."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Powers = tuple[int, ...]
"""the power of each variable in one term"""


def powers_up_to(degree: int, variables: int) -> list[Powers]:
    """Return the powers of all terms of at most this degree."""
    return [powers for powers in itertools.product(range(degree + 1), repeat=variables) if sum(powers) <= degree]


def terms_of(variables: Sequence[NDArray[np.floating]], powers: Sequence[Powers]) -> Array:
    """Return the (N, K) terms of variables that are (N,) each; a term is made of the one with a power less."""
    known: dict[Powers, Array] = {(0,) * len(variables): np.ones(len(variables[0]))}

    def term(of: Powers, row: Array | None = None) -> Array:
        if of not in known:
            last = max(i for i, power in enumerate(of) if power)
            less = (*of[:last], of[last] - 1, *of[last + 1 :])
            known[of] = np.multiply(term(less), variables[last], out=row)
        return known[of]

    rows = np.empty((len(powers), len(variables[0])))  # a term lies together in memory, which is fast to fill
    for row, of in zip(rows, powers, strict=True):
        row[:] = term(of, row)
    return rows.T
