"""The benchmark objects as files: height maps to compute with, solids to print and press."""

import io

import numpy as np
from numpy.typing import NDArray

from gellight.frames.point_cloud import solid_stl
from sim_reference.deformation import grid
from sim_reference.objects import BENCHMARK_NAMES, ObjectParameters, object_height

Array = NDArray[np.float64]
SIDE_MM = 36.0
"""of the square that holds an object"""
FOOT_MM = 5.0
"""of solid below the lowest point of the relief"""


def benchmark_files(relief_mm: float = 1.0, size: int = 512) -> dict[str, bytes | str]:
    """Return every object by file name: NAME.npy, (size, size) float32 mm, and NAME.stl."""
    files: dict[str, bytes | str] = {}
    for name in BENCHMARK_NAMES:
        height, spacing = benchmark_height(name, relief_mm, size)
        content = io.BytesIO()
        np.save(content, height.astype(np.float32))
        files[f"{name}.npy"] = content.getvalue()
        limited = np.maximum(height, -2 * relief_mm)
        files[f"{name}.stl"] = solid_stl(limited, spacing, limited.min() - FOOT_MM)
    return files


def benchmark_height(name: str, relief_mm: float, size: int) -> tuple[Array, float]:
    """Return an object's height map (size, size) in mm, highest point 0, and its spacing in mm."""
    spacing = SIDE_MM / size
    at = grid(size, spacing)
    return object_height(name, at[None, :], at[:, None], ObjectParameters(relief_mm=relief_mm)), spacing
