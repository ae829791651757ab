"""Touches of a body in their places, as one surface: a mesh with its errors, open where nothing touched.

Around each touch the signed distance to it is kept on a grid, positive outside the body, and averaged over all touches
by their stated errors (Curless and Levoy, SIGGRAPH 1996). The body is where the mean is 0 (marching cubes of PyMCubes).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gellight.base.errors import InputError
from gellight.frames.point_cloud import mesh_stl, ply_file
from gellight.reconstruction.integration import surface_gradient
from gellight_scan.contact_view import ContactView
from gellight_scan.tracking.rigid import carried, inverse

Array = NDArray[np.float64]
NOTHING = "the gel reached too little of the body for a surface: press it deeper"
FINEST_MM = 0.1
"""between the points of the grid: the coating blurs as much"""
MOST_POINTS = 28_000_000
"""of the grid: larger bodies get a coarser one. With all that is computed of it, that is 2 GB"""
COARSEST_MM = 1.0
"""touches that lie farther apart are of no body that a gel can show"""
UNSURE_VERTEX = np.dtype([("xyz", "<f4", 3), ("error_mm", "<f4")])
BAND = 3.0
"""so many steps of the grid to both sides of a touch the distance is kept"""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles."""

    points_mm: Array
    """(V, 3) in the axes of the sensor at the first touch: x right, y down, z towards the camera"""
    triangles: NDArray[np.int64]
    """(T, 3) points"""
    error_mm: Array
    """(V,) standard deviation"""
    seam_mm: float
    """rms by which touches are off the surface where several touched it; NaN where none did"""
    step_mm: float
    """of the grid that it was found on: nothing finer is in it"""

    @property
    def area_mm2(self) -> float:
        """How much of the body was touched."""
        a, b, c = (self.points_mm[self.triangles[:, corner]] for corner in range(3))
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)

    @property
    def size_mm(self) -> Array:
        """(3,) of the box around it."""
        return np.asarray(np.ptp(self.points_mm, axis=0))

    def ply(self) -> bytes:
        """Return a PLY file, y up so that it is no mirror image; each point has its `error_mm`."""
        points_mm, triangles = self._righted()
        vertices = np.empty(len(points_mm), UNSURE_VERTEX)
        vertices["xyz"], vertices["error_mm"] = points_mm, self.error_mm
        return ply_file(vertices, ["float error_mm"], triangles)

    def stl(self) -> bytes:
        """Return an STL file, y up; it is open where nothing touched."""
        return mesh_stl(*self._righted())

    def _righted(self) -> tuple[Array, NDArray[np.int64]]:
        return self.points_mm * [1.0, -1.0, 1.0], self.triangles


@dataclass(frozen=True, eq=False)
class Distances:
    """Sums over touches at the points of a grid; first all are added, then it is asked."""

    axes_mm: tuple[Array, Array, Array]
    weight: Array
    total: Array
    squares: Array
    count: NDArray[np.int32]

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Where any touch was."""
        return np.asarray(self.weight > 0)

    @cached_property
    def mean(self) -> Array:
        """Mean distance, 0 where nothing touched."""
        return self._over_weight(self.total)

    @cached_property
    def spread(self) -> Array:
        """Mean square by which touches are off it."""
        return np.maximum(self._over_weight(self.squares) - self.mean**2, 0)

    @cached_property
    def variance(self) -> Array:
        """Of the mean: a peak is misjudged alike in every touch, so that many make it no better."""
        return self._over_weight(self.count) + self.spread

    def _over_weight(self, plane: NDArray[Any]) -> Array:
        return np.asarray(np.divide(plane, self.weight, out=np.zeros(self.weight.shape), where=self.known))

    @classmethod
    def over(cls, surface_mm: Array, step_mm: float) -> "Distances":
        """Return an empty grid around points (N, 3)."""
        margin = (BAND + 1) * step_mm
        x, y, z = (np.arange(at.min() - margin, at.max() + margin, step_mm) for at in surface_mm.T)
        shape = len(x), len(y), len(z)
        return cls((x, y, z), np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape, np.int32))

    def add(self, view: ContactView, pose: Array, surface_mm: Array, band_mm: float) -> None:
        """Add a touch, whose pose (4, 4) carries it to the body and its points there to `surface_mm` (N, 3)."""
        ends = surface_mm.min(axis=0) - band_mm, surface_mm.max(axis=0) + band_mm
        box = tuple(
            slice(*np.searchsorted(axis, (low, high))) for axis, low, high in zip(self.axes_mm, *ends, strict=True)
        )
        parts = [axis[part] for axis, part in zip(self.axes_mm, box, strict=True)]
        points = np.stack(np.meshgrid(*parts, indexing="ij"), axis=-1)
        distance, error = distance_to(view, carried(inverse(pose), points))
        weight = np.where(np.abs(distance) < band_mm, error**-2, 0.0)
        self.weight[box] += weight
        self.total[box] += weight * distance
        self.squares[box] += weight * distance**2
        self.count[box] += weight > 0


def distance_to(view: ContactView, points_mm: Array) -> tuple[Array, Array]:
    """Return signed distances (...) of points (..., 3) to the gel of a touch, and their errors, mm.

    Beside the contact the errors are infinite.
    """
    middle = [(size - 1) / 2 for size in view.depth_mm.shape]
    at = points_mm[..., 1] / view.pixel_size_mm[1] + middle[0], points_mm[..., 0] / view.pixel_size_mm[0] + middle[1]
    slopes = surface_gradient(view.depth_mm, view.pixel_size_mm)
    upright = 1 / np.sqrt(1 + (slopes.astype(np.float64) ** 2).sum(axis=-1))
    depth, upright, error = (
        map_coordinates(plane, at, order=1, mode="nearest", output=np.float64)
        for plane in (view.depth_mm, upright, view.error_mm)
    )
    reached = map_coordinates(view.reached.astype(np.uint8), at, order=0, mode="constant") > 0
    return (points_mm[..., 2] - depth) * upright, np.where(reached, error / upright, np.inf)


def step_for(size_mm: Array) -> float:
    """Return the step of a grid around a box (3,) and its margins; InputError for a box that is too large for any."""
    step_mm = FINEST_MM
    while np.prod(size_mm / step_mm + 2 * (BAND + 1) + 1) > MOST_POINTS:
        step_mm *= 1.02
    if step_mm > COARSEST_MM:
        x, y, z = size_mm
        raise InputError(
            f"the touches lie over {x:.0f} x {y:.0f} x {z:.0f} mm, too much for a mesh: scan the body in parts"
        )
    return step_mm


def fused(touches: Sequence[tuple[ContactView, Array]]) -> Mesh:
    """Return the surface that touches lie on; each pose (4, 4) carries its touch to the body.

    Raises InputError where PyMCubes is not installed, and where no touch reached the body.
    """
    import mcubes  # here, as nothing else needs it

    laid = [carried(pose, surface_of(view)) for view, pose in touches]
    every = np.concatenate(laid)
    if not len(every):
        raise InputError(NOTHING)
    step_mm = step_for(np.ptp(every, axis=0))
    grid = Distances.over(every, step_mm)
    for (view, pose), surface in zip(touches, laid, strict=True):
        if len(surface):
            grid.add(view, pose, surface, BAND * step_mm)
    points, triangles = mcubes.marching_cubes(np.where(grid.known, grid.mean, BAND * step_mm), 0.0)
    triangles = triangles[_among(grid.known, points)[triangles].all(axis=1)].astype(np.int64)
    if not len(triangles):
        raise InputError(NOTHING)
    used, numbers = np.unique(triangles, return_inverse=True)
    several = (grid.count > 1) & (np.abs(grid.mean) < step_mm)
    return Mesh(
        points_mm=points[used] * step_mm + [axis[0] for axis in grid.axes_mm],
        triangles=numbers.reshape(-1, 3),
        error_mm=np.sqrt(map_coordinates(grid.variance, points[used].T, order=1, mode="nearest")),
        seam_mm=float(np.sqrt(grid.spread[several].mean())) if several.any() else float("nan"),
        step_mm=step_mm,
    )


def surface_of(view: ContactView) -> Array:
    """Return the (N, 3) points of a touch where the gel reached the body."""
    rows, columns = np.nonzero(view.reached)
    middle = [(size - 1) / 2 for size in view.depth_mm.shape]
    x, y = (columns - middle[1]) * view.pixel_size_mm[0], (rows - middle[0]) * view.pixel_size_mm[1]
    return np.stack([x, y, view.depth_mm[rows, columns]], axis=1)


def _among(known: NDArray[np.bool_], points: Array) -> NDArray[np.bool_]:
    """Say which points (V, 3) of the grid's edges lie between two of its points that are `known`."""
    low, high = np.floor(points).astype(np.intp), np.ceil(points).astype(np.intp)
    return np.asarray(known[tuple(low.T)] & known[tuple(high.T)])
