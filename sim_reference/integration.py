"""Depth from slopes by sparse least squares: plain, and on purpose not the method of the host, which it judges."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]


def integrate(gradient_map: Array, pixel_size_mm: float | tuple[float, float]) -> Array:
    """Return the depth (H, W) in mm whose differences fit (H, W, 2) slopes best; its median is 0.

    Minimises, over all pairs of neighbours a, b, the squares of z_b - z_a - h (g_a + g_b) / 2 with the pixel size h
    along the pair: the trapezoid rule on every edge. `pixel_size_mm` is one size or (x, y). The solution is direct and
    takes memory: meant for maps up to some 300 x 300.
    """
    slopes = np.asarray(gradient_map, dtype=np.float64)
    if slopes.ndim != 3 or slopes.shape[2] != 2 or min(slopes.shape[:2]) < 2:
        raise ValueError(f"gradient map of shape {slopes.shape}: give (H, W, 2) with H, W >= 2")
    size_x, size_y = np.broadcast_to(np.asarray(pixel_size_mm, dtype=np.float64), 2)
    height, width = slopes.shape[:2]
    rise_x = size_x * (slopes[:, 1:, 0] + slopes[:, :-1, 0]) / 2
    rise_y = size_y * (slopes[1:, :, 1] + slopes[:-1, :, 1]) / 2
    held, solve = _system(height, width)
    depth = np.concatenate([[0.0], solve(held.T @ np.concatenate([rise_x.ravel(), rise_y.ravel()]))])
    return np.asarray(depth.reshape(height, width) - np.median(depth))


@lru_cache(maxsize=1)
def _system(height: int, width: int) -> tuple[sparse.csc_array, Callable[[Array], Array]]:
    """Return the differences between neighbours as a matrix, and what solves its normal equations.

    The constant is free: holding the first pixel at 0 leaves a matrix that can be solved. It is symmetric and positive:
    ordered as such its factors take 58 % of the memory.
    """
    along_x = sparse.kron(sparse.identity(height), _difference(width))
    along_y = sparse.kron(_difference(height), sparse.identity(width))
    held = sparse.csc_array(sparse.vstack([along_x, along_y]).tocsc()[:, 1:])
    factors = splu(sparse.csc_matrix(held.T @ held), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return held, factors.solve


def _difference(count: int) -> sparse.dia_array:
    """(count - 1, count) matrix of differences between neighbours."""
    return sparse.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(count - 1, count))
