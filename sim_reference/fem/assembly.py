"""From the shares of tetrahedra, patches and contacts to one gradient and one sparse matrix over the free vertices."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from sim_reference.fem.mesh import Indices

Array = NDArray[np.float64]
AT_ONCE = 2048
"""blocks: what is written entry by entry stays in the processor's cache"""
TRANSPOSED = [0, 3, 6, 1, 4, 7, 2, 5, 8]
"""entries of a transposed block"""


@dataclass(frozen=True, eq=False)
class Pattern:
    """Which 3 x 3 blocks of a sparse matrix are there, as in scipy's BSR format."""

    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]

    def matrix(self, blocks: Array | NDArray[np.float32]) -> sp.bsr_matrix:
        """Return the matrix of `blocks` (B, 3, 3)."""
        size = 3 * (len(self.indptr) - 1)
        return sp.bsr_matrix((blocks, self.indices, self.indptr), shape=(size, size))

    @property
    def rows(self) -> Indices:
        """(B,) row of each block."""
        return np.repeat(np.arange(len(self.indptr) - 1), np.diff(self.indptr))

    @property
    def diagonal(self) -> Indices:
        """(n,) where the blocks of the diagonal are."""
        return np.flatnonzero(self.rows == self.indices)


class Assembler:
    """Adds up shares. `numbers` (N,) is each vertex's row in the matrix, ascending, -1 where it is fixed.

    The energies do not change where all vertices of a share move alike. So the blocks of the diagonal follow from the
    others, also from those of fixed vertices, and because the matrix is symmetric, half of these are enough.
    """

    def __init__(self, numbers: Indices, groups: list[Indices]) -> None:
        """Prepare for shares of `groups`, each (G, C): the vertices of its members, ascending, then -1 for none."""
        count, free = len(numbers), int(numbers.max()) + 1
        keys = [_pairs(group, count) for group in groups]
        # A pair of fixed vertices is not in the matrix.
        keys = [np.where((numbers[key // count] >= 0) | (numbers[key % count] >= 0), key, -1) for key in keys]
        there = np.unique(np.concatenate([key[key >= 0] for key in keys]))
        self._sums = [_summation(there, key) for key in keys]
        first, second = numbers[np.array(np.divmod(there, count))]
        self._of_first, self._of_second = (_rows(number, free) for number in (first, second))
        both = np.flatnonzero((first >= 0) & (second >= 0))
        rows = np.concatenate([first[both], second[both], np.arange(free)])
        columns = np.concatenate([second[both], first[both], np.arange(free)])
        order = np.lexsort((columns, rows))
        self._order = np.concatenate([both, len(there) + both, 2 * len(there) + np.arange(free)])[order]
        indptr = np.searchsorted(rows[order], np.arange(free + 1)).astype(np.int32)
        self.pattern = Pattern(columns[order].astype(np.int32), indptr)

    def blocks(self, shares: list[Array]) -> Array:
        """Return the blocks (B, 3, 3) of the sum of `shares`, one (3, 3, pairs of corners, G) for each group."""
        upper = np.stack([sum(at @ share[place].ravel() for at, share in zip(self._sums, shares, strict=True))
                          for place in np.ndindex(3, 3)])  # fmt: skip
        count, free = upper.shape[1], self._of_first.shape[0]
        found = np.empty((2 * count + free, 9))
        here, flipped, diagonal = np.split(found, [count, 2 * count])
        for begin in range(0, count, AT_ONCE):
            now = slice(begin, begin + AT_ONCE)
            here[now], flipped[now] = upper[:, now].T, upper[TRANSPOSED, now].T
        diagonal[:] = -(self._of_first @ here) - self._of_second @ flipped
        return found.take(self._order, axis=0).reshape(-1, 3, 3)


def _pairs(group: Indices, count: int) -> Indices:
    """One number for each pair of corners of each member, pair by pair, -1 where there is no corner."""
    first, second = group.T[np.transpose(list(combinations(range(group.shape[1]), 2)))]
    return np.where(second >= 0, first * count + second, -1).ravel()


def _summation(there: Indices, keys: Indices) -> sp.csr_matrix:
    """The matrix of ones that adds up blocks with the same key, and drops those with -1."""
    kept = np.flatnonzero(keys >= 0)
    row = np.searchsorted(there, keys[kept])
    return sp.csr_matrix((np.ones(len(kept)), (row, kept)), shape=(len(there), len(keys)))


def _rows(numbers: Indices, count: int) -> sp.csr_matrix:
    """The matrix of ones that adds up blocks with the same number, and drops those with -1."""
    return _summation(np.arange(count), numbers)
