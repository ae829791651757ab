"""The benchmark objects as files: height maps to compute with, solids to print and press."""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.lab.design.output import write_all
from sim_reference.deformation import grid
from sim_reference.objects import BENCHMARK_NAMES, ObjectParameters, object_height

Array = NDArray[np.float64]
SIDE_MM = 36.0
"""of the square that holds an object"""
FOOT_MM = 5.0
"""of solid below the lowest point of the relief"""
STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def write_benchmark(folder: Path, relief_mm: float, size: int) -> list[Path]:
    """Write every object as NAME.npy, (size, size) float32 mm, and NAME.stl; raises InputError if that fails."""
    files: dict[str, bytes | str] = {}
    for name in BENCHMARK_NAMES:
        height, spacing = benchmark_height(name, relief_mm, size)
        content = io.BytesIO()
        np.save(content, height.astype(np.float32))
        files[f"{name}.npy"] = content.getvalue()
        files[f"{name}.stl"] = solid_stl(np.maximum(height, -2 * relief_mm), spacing)
    return write_all(folder, files)


def benchmark_height(name: str, relief_mm: float, size: int) -> tuple[Array, float]:
    """Return an object's height map (size, size) in mm, highest point 0, and its spacing in mm."""
    spacing = SIDE_MM / size
    at = grid(size, spacing)
    return object_height(name, at[None, :], at[:, None], ObjectParameters(relief_mm=relief_mm)), spacing


def solid_stl(height_mm: Array, spacing_mm: float) -> bytes:
    """Return a closed solid in binary STL: the height map (H, W) on a foot, z towards the gel, y up as printed."""
    top, bottom = _corners(height_mm, spacing_mm)
    faces = np.concatenate([_two_triangles(top), _two_triangles(bottom)[:, ::-1], _walls(top, bottom)])
    across = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    records = np.zeros(len(faces), STL_RECORD)
    records["normal"], records["corners"] = across / np.maximum(length, 1e-12), faces
    return b"GelLight benchmark, mm".ljust(80) + np.uint32(len(faces)).tobytes() + records.tobytes()


def _corners(height_mm: Array, spacing_mm: float) -> tuple[Array, Array]:
    rows, columns = height_mm.shape
    x = (np.arange(columns) - (columns - 1) / 2) * spacing_mm
    y = -(np.arange(rows) - (rows - 1) / 2) * spacing_mm
    grid_x, grid_y = np.meshgrid(x, y)
    floor = np.full(height_mm.shape, height_mm.min() - FOOT_MM)
    return np.stack([grid_x, grid_y, height_mm], axis=-1), np.stack([grid_x, grid_y, floor], axis=-1)


def _two_triangles(corners: Array) -> Array:
    """Split every cell of (H, W, 3) corners into two triangles, anticlockwise as seen from above."""
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def _walls(top: Array, bottom: Array) -> Array:
    upper, lower = (np.concatenate([c[:, 0], c[-1, 1:], c[-2::-1, -1], c[0, -2::-1]]) for c in (top, bottom))
    first = np.stack([upper[:-1], lower[:-1], lower[1:]], axis=1)
    second = np.stack([upper[:-1], lower[1:], upper[1:]], axis=1)
    return np.concatenate([first, second])
