"""Conjugate gradients, preconditioned by a multigrid cycle over the nested meshes.

The matrix of a coarser mesh is P^T A P, with P the prolongation. The pattern of A never changes, so what the product
does to its 3 x 3 blocks is prepared once, as two sparse matrices that act on the list of blocks. Each level is smoothed
by Chebyshev's polynomials of the block-Jacobi iteration, the coarsest is factorised. A cycle computes with
numbers of 32 bits, which halves the memory that it reads; conjugate gradients correct what that rounds off.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg
from numpy.typing import NDArray

from sim_reference.fem.assembly import Pattern
from sim_reference.fem.mesh import Indices, Mesh

Array = NDArray[np.float64]
Short = NDArray[np.float32]
Integers = NDArray[np.int64] | NDArray[np.int32]
SMOOTHING_DEGREE = 2
SMOOTHED_SHARE = 12.0
"""the smoother damps eigenvalues from the largest down to the largest over this"""


@dataclass(frozen=True)
class _Coarsening:
    """From the blocks of one level's matrix to those of the next coarser one."""

    prolongation: sp.bsr_matrix
    """of 32 bits"""
    restriction: sp.bsr_matrix
    """its transpose"""
    pattern: Pattern
    right: sp.csr_matrix
    """blocks of A P from those of A"""
    left: sp.csr_matrix
    """blocks of P^T (A P) from those of A P"""

    def blocks(self, fine: Array) -> Array:
        """Return the blocks of P^T A P."""
        return np.asarray(self.left @ (self.right @ fine.reshape(-1, 9))).reshape(-1, 3, 3)


class Hierarchy:
    """The levels of a mesh, prepared for matrices of one pattern over its free vertices."""

    def __init__(self, mesh: Mesh, pattern: Pattern) -> None:
        """Prepare the products of all levels."""
        self.pattern = pattern
        self._coarsenings = []
        kept = mesh.free
        for prolongation in reversed(mesh.prolongations):
            rows = prolongation[kept]
            movable = np.flatnonzero(mesh.vertices[: rows.shape[1], 2] < mesh.thickness_mm)
            kept = np.intersect1d(np.unique(rows.indices), movable)
            self._coarsenings.append(_coarsening(pattern, rows[:, kept]))
            pattern = self._coarsenings[-1].pattern

    def solver(self, blocks: Array) -> "Multigrid":
        """Return the preconditioner of the matrix with `blocks`."""
        levels, pattern = [], self.pattern
        for coarsening in self._coarsenings:
            levels.append(_Level(pattern, blocks.astype(np.float32), coarsening))
            blocks, pattern = coarsening.blocks(blocks), coarsening.pattern
        return Multigrid(levels, pattern.matrix(blocks))


class _Level:
    """One level's matrix and its smoother."""

    def __init__(self, pattern: Pattern, blocks: Short, coarsening: _Coarsening) -> None:
        self.matrix = pattern.matrix(blocks)
        self.prolongation, self.restriction = coarsening.prolongation, coarsening.restriction
        diagonal = np.linalg.inv(blocks[pattern.diagonal])
        rows = np.arange(len(diagonal) + 1)
        self._jacobi = sp.bsr_matrix((diagonal, rows[:-1], rows), shape=self.matrix.shape)
        self._largest = 1.1 * self._largest_eigenvalue()

    def _largest_eigenvalue(self) -> float:
        vector, size = np.random.default_rng(0).random(self.matrix.shape[0], np.float32) - np.float32(0.5), 1.0
        for _ in range(8):
            vector = self._jacobi @ (self.matrix @ (vector / size))
            size = float(np.linalg.norm(vector))
        return size

    def smooth(self, wanted: Short, at: Short | None = None) -> Short:
        """Return a better solution of A x = wanted than `at`, 0 by default (Saad, Iterative Methods, 12.3.2)."""
        middle = (1 + 1 / SMOOTHED_SHARE) / 2 * self._largest
        half = (1 - 1 / SMOOTHED_SHARE) / 2 * self._largest
        residual = wanted if at is None else wanted - self.matrix @ at
        rho = half / middle
        change = self._jacobi @ residual / middle
        solution = change if at is None else at + change
        for _ in range(SMOOTHING_DEGREE - 1):
            residual = residual - self.matrix @ change
            following = 1 / (2 * middle / half - rho)
            change = following * rho * change + 2 * following / half * (self._jacobi @ residual)
            rho, solution = following, solution + change
        return np.asarray(solution)


class Multigrid:
    """One V cycle: an approximate solution of A x = b."""

    def __init__(self, levels: list[_Level], coarsest: sp.bsr_matrix) -> None:
        """Factorise the coarsest level."""
        self._levels = levels
        # Outside the rim, coarse vertices may act on the same fine ones alone: together they are not independent.
        shift = 1e-10 * coarsest.diagonal().max()
        shifted = (coarsest + shift * sp.identity(coarsest.shape[0])).tocsc()
        symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
        self._solve = scipy.sparse.linalg.splu(shifted, **symmetric).solve

    def __call__(self, wanted: Array) -> Array:
        """Return the approximate solution."""
        return self._cycle(wanted.astype(np.float32), 0).astype(np.float64)

    def _cycle(self, wanted: Short, level: int) -> Short:
        if level == len(self._levels):
            return np.asarray(self._solve(wanted.astype(np.float64)), np.float32)
        here = self._levels[level]
        solution = here.smooth(wanted)
        left = here.restriction @ (wanted - here.matrix @ solution)
        return here.smooth(wanted, solution + here.prolongation @ self._cycle(left, level + 1))


@dataclass(frozen=True, eq=False)
class Solution:
    """What conjugate gradients found."""

    vector: Array
    iterations: int
    convex: bool
    """false: the matrix has a direction of negative curvature, and the vector goes on along it"""


def conjugate_gradients(
    matrix: sp.bsr_matrix, wanted: Array, precondition: Callable[[Array], Array], tolerance: float, limit: int = 300
) -> Solution:
    """Solve A x = wanted until the preconditioned residual has fallen by `tolerance`, at most `limit` iterations.

    A direction of negative curvature ends it (Steihaug, SIAM J. Numer. Anal. 20, 1983): it goes as far along that one
    as with the same curvature upwards.
    """
    solution, residual = np.zeros_like(wanted), wanted
    direction = ahead = precondition(residual)
    norm = first = float(residual @ ahead)
    if first <= 0:
        return Solution(solution, 0, convex=first == 0)
    for iteration in range(1, limit + 1):
        change = matrix @ direction
        curvature = float(direction @ change)
        if curvature <= 0:
            return Solution(solution + norm / max(-curvature, 1e-300) * direction, iteration, convex=False)
        step = norm / curvature
        solution, residual = solution + step * direction, residual - step * change
        ahead = precondition(residual)
        previous, norm = norm, float(residual @ ahead)
        if norm < 0:
            return Solution(solution, iteration, convex=False)
        if norm <= tolerance**2 * first:
            break
        direction = ahead + norm / previous * direction
    return Solution(solution, iteration, convex=True)


def _coarsening(pattern: Pattern, prolongation: sp.csr_matrix) -> _Coarsening:
    """Prepare P^T A P for matrices A of `pattern`."""
    coarse = prolongation.shape[1]
    half_rows, half_columns, right = _product(pattern.rows, pattern.indices, prolongation)
    # P^T (A P) adds up rows as A P adds up columns.
    columns, rows, left = _product(half_columns, half_rows, prolongation)
    order = np.lexsort((columns, rows))
    indptr = np.searchsorted(rows[order], np.arange(coarse + 1)).astype(np.int32)
    result = Pattern(columns[order].astype(np.int32), indptr)
    vectors = sp.kron(prolongation.astype(np.float32), sp.identity(3, np.float32), format="bsr")
    return _Coarsening(vectors, vectors.T.tobsr((3, 3)), result, right, left[order])


def _product(kept: Integers, expanded: Integers, prolongation: sp.csr_matrix) -> tuple[Indices, Indices, sp.csr_matrix]:
    """Return where (kept, new) the blocks of a product with P are, and the matrix that makes them from the given."""
    counts = np.diff(prolongation.indptr)[expanded]
    block = np.repeat(np.arange(len(expanded)), counts)
    entry = np.arange(counts.sum()) + np.repeat(prolongation.indptr[expanded] - np.cumsum(counts) + counts, counts)
    coarse = prolongation.shape[1]
    unique, place = np.unique(kept[block] * np.int64(coarse) + prolongation.indices[entry], return_inverse=True)
    rows, columns = np.divmod(unique, coarse)
    weights = sp.csr_matrix((prolongation.data[entry], (place, block)), shape=(len(unique), len(expanded)))
    return rows, columns, weights
