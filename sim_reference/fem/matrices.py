"""3 x 3 matrices, one for each of many tetrahedra: arrays (3, 3, T).

The tetrahedra come last, so that NumPy works on long rows: several times faster than its own functions for (T, 3, 3).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
    """Return the eigenvalues (3, T) of symmetric matrices, and their eigenvectors as columns (3, 3, T)."""
    values, vectors = np.linalg.eigh(np.moveaxis(matrix, -1, 0))
    return np.ascontiguousarray(values.T), np.ascontiguousarray(np.moveaxis(vectors, 0, -1))
