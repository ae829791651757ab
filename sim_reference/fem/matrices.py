"""3 x 3 matrices, one for each of many tetrahedra: arrays (3, 3, T).

The tetrahedra come last, so that NumPy works on long rows: several times faster than its own functions for (T, 3, 3).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST_SWEEPS = 10
SMALLEST = 1e-300
"""instead of a division by 0"""


def product(one: Array, other: Array) -> Array:
    """Return the matrix product (I, J, ..., T) of (I, K, ..., T) and (K, J, ..., T)."""
    result = one[:, :1] * other[:1]
    for k in range(1, len(other)):
        result += one[:, k, None] * other[None, k]
    return np.asarray(result)


def transposed(matrix: Array) -> Array:
    """Return the transpose of each matrix."""
    return matrix.swapaxes(0, 1)


def cofactors(matrix: Array) -> Array:
    """Return the derivative of the determinant by each entry: det M times the inverse transposed."""
    result = np.empty_like(matrix)
    for i in range(3):
        for j in range(3):
            (a, b), (c, d) = ((i + 1) % 3, (i + 2) % 3), ((j + 1) % 3, (j + 2) % 3)
            result[i, j] = matrix[a, c] * matrix[b, d] - matrix[a, d] * matrix[b, c]
    return result


def inner(one: Array, other: Array) -> Array:
    """Return the sum (T,) of the products of all entries."""
    return np.asarray(np.einsum("ijt,ijt->t", one, other))


def determinant(matrix: Array) -> Array:
    """Return the determinant (T,) of each matrix."""
    return np.asarray((matrix[0] * cofactors(matrix)[0]).sum(axis=0))


def eigenvectors(matrix: Array) -> tuple[Array, Array]:
    """Return the eigenvalues (3, T) of symmetric matrices, and their eigenvectors as columns (3, 3, T).

    Jacobi's rotations (Golub and Van Loan, Matrix Computations, 8.5): three times faster than NumPy's own for many.
    """
    matrix, vectors = matrix.copy(), np.zeros_like(matrix)
    for axis in range(3):
        vectors[axis, axis] = 1
    for _ in range(MOST_SWEEPS):
        beside = np.abs([matrix[0, 1], matrix[0, 2], matrix[1, 2]]).max(axis=0)
        if (beside <= 1e-15 * np.abs(np.einsum("iit->it", matrix)).max(axis=0)).all():
            break
        for k, m in ((0, 1), (0, 2), (1, 2)):
            _rotate(matrix, vectors, k, m)
    return np.einsum("iit->it", matrix).copy(), vectors


def _rotate(matrix: Array, vectors: Array, k: int, m: int) -> None:
    """Turn axes k and m so that the entry between them becomes 0; entries above the diagonal are kept alone."""
    between, apart = matrix[k, m], matrix[m, m] - matrix[k, k]
    root = np.abs(apart) + np.sqrt(apart**2 + 4 * between**2)
    tangent = 2 * between * np.copysign(1.0, apart) / np.maximum(root, SMALLEST)
    cosine = 1 / np.sqrt(1 + tangent**2)
    sine = tangent * cosine
    matrix[k, k] -= tangent * between
    matrix[m, m] += tangent * between
    matrix[k, m] = 0
    other = 3 - k - m
    of_k, of_m = (matrix[min(other, axis), max(other, axis)] for axis in (k, m))
    of_k[:], of_m[:] = cosine * of_k - sine * of_m, sine * of_k + cosine * of_m
    vectors[:, k], vectors[:, m] = (
        cosine * vectors[:, k] - sine * vectors[:, m],
        sine * vectors[:, k] + cosine * vectors[:, m],
    )
