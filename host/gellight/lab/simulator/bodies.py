"""Rigid bodies that can be turned about any axis: meshes, and what of them meets the gel.

A body is in its own axes: x right, y down, z towards the camera. The objects of the benchmark become bodies as their
surface over a grid, cut by a circle where that is asked: a stamp that tilts on its own edge, not on that of a plate.
Beads, a peg and a bar are bodies by themselves; all their measures are ours.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gellight.lab.simulator.objects import check_name, object_height
from sim_reference.deformation import NO_OBJECT, grid

Array = NDArray[np.float64]
MESH_MM = 0.05
"""between the vertices of a body"""
LEFT_OUT_MM = 3.5
"""what lies deeper below the highest point never meets the gel"""
WAVES = 14
"""plane waves whose mean is the relief of a bead"""


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body; the pose of its axes is the pose of the body."""

    vertices: Array
    """(V, 3) mm"""
    faces: NDArray[np.int64]
    """(F, 3) numbers of vertices"""

    def upper_side(self, rotation: Array, size: int, spacing_mm: float) -> tuple[Array, float]:
        """Return the height (size, size) in mm of the turned body, highest point 0, NO_OBJECT beside it; and its top.

        `rotation` (3, 3) turns the body about its origin, which lies in the middle of the grid. The top is the z of
        the highest point on the grid, mm from the origin.
        """
        turned = self.vertices @ np.asarray(rotation, np.float64).T
        near = (turned[:, 2] > turned[:, 2].max() - LEFT_OUT_MM)[self.faces].all(axis=1)
        height = highest(turned[self.faces[near]], size, spacing_mm)
        top = float(height.max())
        return np.where(height > NO_OBJECT / 2, height - top, NO_OBJECT), top

    @property
    def reach_mm(self) -> float:
        """How far the body reaches from its origin."""
        return float(np.linalg.norm(self.vertices, axis=1).max())


def bead(radius_mm: float, relief_mm: float, waves: tuple[float, float], seed: int) -> Body:
    """Return a ball about its origin whose radius varies by `relief_mm` times twice the mean of random waves.

    `waves` are the least and largest number of waves on 2 pi radii; the standard deviation of the relief is 0.38 of
    `relief_mm`.
    """
    unit, faces = _unit_ball(round(radius_mm / MESH_MM))
    return Body(unit * bead_radius_mm(radius_mm, relief_mm, waves, seed)(unit)[:, None], faces)


def bead_radius_mm(
    radius_mm: float, relief_mm: float, waves: tuple[float, float], seed: int
) -> Callable[[Array], Array]:
    """Return the function that gives the radius (N,) of a `bead` along directions (N, 3) of unit length."""
    random = np.random.default_rng(seed)
    directions = random.normal(size=(WAVES, 3))
    directions *= random.uniform(*waves, (WAVES, 1)) / np.linalg.norm(directions, axis=1, keepdims=True)
    phases = random.uniform(0, 2 * np.pi, WAVES)
    return lambda unit: radius_mm + relief_mm * 2 * np.sin(unit @ directions.T + phases).mean(axis=1)


def peg(x: Array, y: Array) -> Array:
    """Return the end of a peg, 6 by 10 mm, slightly curved, with a boss beside its middle that stands 0.1 mm out."""
    end = np.where((np.abs(x) < 3) & (np.abs(y) < 5), -0.02 * x**2 - 0.01 * y**2, NO_OBJECT)
    return np.maximum(end, _boss(np.hypot(x - 1, y - 2) / 1.2))


def key(x: Array, y: Array) -> Array:
    """Return the end of a key, 8 by 5 mm, slightly curved, with two bosses of unlike width that stand 0.1 mm out."""
    end = np.where((np.abs(x) < 4) & (np.abs(y) < 2.5), -0.015 * x**2 - 0.02 * y**2, NO_OBJECT)
    return np.maximum(end, np.maximum(_boss(np.hypot(x - 2, y - 0.5)), _boss(np.hypot(x + 1.5, y + 1) / 0.7)))


def bar(x: Array, y: Array) -> Array:
    """Return the upper side of a cylinder of 3 mm radius along x, longer than any gel."""
    return np.where(np.abs(y) < 3, np.sqrt(np.maximum(9 - y**2, 0)) - 3 + 0 * x, NO_OBJECT)


HEIGHTS: dict[str, Callable[[Array, Array], Array]] = {"PEG": peg, "KEY": key, "BAR": bar}
BEADS: dict[str, tuple[float, float, tuple[float, float], int]] = {
    "BEAD": (4.0, 0.2, (3.0, 7.0), 1),
    "FINEBEAD": (4.0, 0.15, (12.0, 24.0), 3),
    "LARGEBEAD": (5.0, 0.2, (3.0, 7.0), 7),
    "GENTLEBEAD": (6.0, 0.12, (2.0, 5.0), 11),
    "MARBLE": (4.0, 0.0, (1.0, 2.0), 0),
}
"""radius and relief in mm, waves, seed"""
BODY_NAMES = (*HEIGHTS, *BEADS)


@lru_cache(maxsize=8)
def body(name: str, within_mm: float = 0.0) -> Body:
    """Return a body by its name, or an object of the benchmark as one.

    What is a height over x and y is cut by a circle of radius `within_mm`, unless that is 0. Raises ValueError for an
    unknown name, and for a circle about a bead.
    """
    check_name(name, BODY_NAMES)
    if name in BEADS:
        if within_mm:
            raise ValueError(f"{name} is a whole bead: leave out the circle of {within_mm:g} mm that cuts it")
        return bead(*BEADS[name])
    half = within_mm or 25.0
    at = grid(2 * round(half / MESH_MM) + 1, MESH_MM)
    x, y = at[None, :], at[:, None]
    height = HEIGHTS[name](x, y) if name in HEIGHTS else object_height(name, x, y)
    inside = np.hypot(x, y) <= half if within_mm else np.full(height.shape, fill_value=True)
    return _over_grid(at, height, inside & (height > NO_OBJECT / 2))


def _boss(r: Array) -> Array:
    """Height of a round boss without an edge, at r radii from its middle; 0.05 mm at its top."""
    return np.where(r < 1, 0.25 * (1 - r**2) ** 2 - 0.2, NO_OBJECT)


def _over_grid(at: Array, height: Array, inside: NDArray[np.bool_]) -> Body:
    """Return the triangles between the points of a grid that are `inside`, the highest of them at z = 0."""
    count = len(at)
    x, y = np.meshgrid(at, at)
    vertices = np.stack([x, y, np.where(inside, height - height[inside].max(), NO_OBJECT)], axis=-1).reshape(-1, 3)
    faces = _squares(count)
    faces = faces[inside.ravel()[faces].all(axis=1)]
    used, renumbered = np.unique(faces, return_inverse=True)
    return Body(vertices[used], renumbered.reshape(-1, 3))


def _unit_ball(steps: int) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and faces of a unit ball: the six sides of a cube in squares, blown up."""
    at = np.tan(np.linspace(-np.pi / 4, np.pi / 4, 2 * steps + 1))
    u, v = (side.ravel() for side in np.meshgrid(at, at))
    one = np.ones_like(u)
    sides = [np.roll(np.stack([sign * one, u, v], axis=1), axis, axis=1) for axis in range(3) for sign in (-1, 1)]
    points = np.concatenate(sides)
    count = len(at)
    faces = np.concatenate([_squares(count) + side * count * count for side in range(6)])
    return points / np.linalg.norm(points, axis=1, keepdims=True), faces


def _squares(count: int) -> NDArray[np.int64]:
    """(T, 3) the two triangles of each square of `count` x `count` points, numbered by rows."""
    number = np.arange(count * count).reshape(count, count)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])


CHUNK = 2_000_000
"""grid points that are looked at together"""


def highest(placed: Array, size: int, spacing_mm: float) -> Array:
    """Return the z (size, size) in mm of the highest of the triangles (T, 3, 3) over each point of a grid.

    The triangles are in the axes of the grid: x right, y down, its middle at 0, 0. NO_OBJECT where there is none.
    """
    start = grid(size, spacing_mm)[0]
    at = (placed[..., :2] - start) / spacing_mm
    first = np.clip(np.ceil(at.min(axis=1) - 1e-9), 0, size).astype(np.int64)
    last = np.clip(np.floor(at.max(axis=1) + 1e-9), -1, size - 1).astype(np.int64)
    counts = np.maximum(last - first + 1, 0)
    heights = np.full(size * size, NO_OBJECT)
    points = counts.prod(axis=1)
    chunks = np.cumsum(points) // CHUNK
    for chunk in np.unique(chunks):
        some = np.flatnonzero((chunks == chunk) & (points > 0))
        _raise(heights, size, at[some], placed[some, :, 2], first[some], counts[some])
    return heights.reshape(size, size)


def _raise(heights: Array, size: int, at: Array, z: Array, first: NDArray[np.int64], counts: NDArray[np.int64]) -> None:
    """Lift the points of the grid that lie under triangles with corners `at` (T, 3, 2), in grid steps, and z (T, 3)."""
    points = counts.prod(axis=1)
    triangle = np.repeat(np.arange(len(at)), points)
    number = np.arange(points.sum()) - np.repeat(np.cumsum(points) - points, points)
    column = first[triangle, 0] + number % counts[triangle, 0]
    row = first[triangle, 1] + number // counts[triangle, 0]
    a, b, c = np.swapaxes(at, 0, 1)
    area = _cross(b - a, c - a)
    upright = np.abs(area) > 1e-12
    inverse = np.where(upright, 1 / np.where(upright, area, 1), 0)[triangle]
    offset = np.column_stack([column, row]) - a[triangle]
    of_b = _cross(offset, (c - a)[triangle]) * inverse
    of_c = _cross((b - a)[triangle], offset) * inverse
    inside = upright[triangle] & (of_b >= -1e-9) & (of_c >= -1e-9) & (of_b + of_c <= 1 + 1e-9)
    height = (1 - of_b - of_c) * z[triangle, 0] + of_b * z[triangle, 1] + of_c * z[triangle, 2]
    np.maximum.at(heights, (row * size + column)[inside], height[inside])


def _cross(one: Array, other: Array) -> Array:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
