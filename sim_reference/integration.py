"""Depth from slopes by sparse least squares: plain, and on purpose not the method of the host, which it judges."""

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

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
    along_x = sparse.kron(sparse.identity(height), _difference(width))
    along_y = sparse.kron(_difference(height), sparse.identity(width))
    rise_x = size_x * (slopes[:, 1:, 0] + slopes[:, :-1, 0]) / 2
    rise_y = size_y * (slopes[1:, :, 1] + slopes[:-1, :, 1]) / 2
    differences = sparse.vstack([along_x, along_y]).tocsc()
    rises = np.concatenate([rise_x.ravel(), rise_y.ravel()])
    # The constant is free: holding the first pixel at 0 leaves a matrix that can be solved.
    held = differences[:, 1:]
    depth = np.concatenate([[0.0], spsolve((held.T @ held).tocsc(), held.T @ rises)]).reshape(height, width)
    return np.asarray(depth - np.median(depth))


def _difference(count: int) -> sparse.dia_array:
    """(count - 1, count) matrix of differences between neighbours."""
    return sparse.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(count - 1, count))
