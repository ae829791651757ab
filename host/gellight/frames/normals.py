"""Gradient map to normal map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def normals(gradient_map: NDArray[np.floating]) -> NDArray[np.float32]:
    """Turn a (H, W, 2) gradient map into (H, W, 3) float32 unit normals (-gx, -gy, 1) / norm, towards the camera.

    Raises ValueError for another shape.
    """
    if gradient_map.ndim != 3 or gradient_map.shape[2] != 2:
        raise ValueError(f"gradient map has shape {gradient_map.shape}: give (H, W, 2)")
    gx, gy = gradient_map[..., 0], gradient_map[..., 1]
    length = np.sqrt(gx * gx + gy * gy + np.float32(1))
    scale = np.reciprocal(length, out=length)
    result = np.empty((*gx.shape, 3), np.float32)
    np.multiply(gx, -scale, out=result[..., 0], casting="same_kind")
    np.multiply(gy, -scale, out=result[..., 1], casting="same_kind")
    result[..., 2] = scale
    return result
