"""From the shares of tetrahedra, patches and contacts to one gradient and one sparse matrix over the free vertices."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from sim_reference.fem.mesh import Indices

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pattern:
    """Which 3 x 3 blocks of a sparse matrix are there, as in scipy's BSR format."""

    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]

    def matrix(self, blocks: Array) -> sp.bsr_matrix:
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
    """Adds up shares. `numbers` (N,) is each vertex's row in the matrix, -1 where it is fixed."""

    def __init__(self, numbers: Indices, groups: list[Indices]) -> None:
        """Prepare for shares of `groups`, each (G, C): the vertices of its members, -1 where there is none."""
        self._free = int(numbers.max()) + 1
        found = [np.where(group >= 0, numbers[group], -1) for group in groups]
        keys = [self._pairs(group) for group in found]
        there = np.unique(np.concatenate([key[key >= 0] for key in keys]))
        rows, columns = np.divmod(there, self._free)
        indptr = np.searchsorted(rows, np.arange(self._free + 1)).astype(np.int32)
        self.pattern = Pattern(columns.astype(np.int32), indptr)
        self._blocks = [_summation(there, key) for key in keys]

    def _pairs(self, group: Indices) -> Indices:
        """One number for each pair of corners, -1 where one of them is fixed."""
        pair = group[:, :, None] * self._free + group[:, None, :]
        return np.where((group[:, :, None] >= 0) & (group[:, None, :] >= 0), pair, -1).ravel()

    def blocks(self, shares: list[Array]) -> Array:
        """Return the blocks (B, 3, 3) of the sum of `shares`, one (G, C, C, 3, 3) for each group."""
        parts = [at @ share.reshape(-1, 9) for at, share in zip(self._blocks, shares, strict=True)]
        return np.asarray(sum(parts)).reshape(-1, 3, 3)


def scattered(vertices: Indices, shares: Array, count: int) -> Array:
    """Return the sum over each vertex of `shares` (..., 3) that belong to `vertices` (...): (count, 3)."""
    at = vertices.ravel()
    return np.stack([np.bincount(at, shares[..., axis].ravel(), count) for axis in range(3)], axis=1)


def _summation(there: Indices, keys: Indices) -> sp.csr_matrix:
    """The matrix of ones that adds up blocks with the same key, and drops those with -1."""
    kept = np.flatnonzero(keys >= 0)
    row = np.searchsorted(there, keys[kept])
    return sp.csr_matrix((np.ones(len(kept)), (row, kept)), shape=(len(there), len(keys)))
