"""Which row and column of the grid each pin is in: from one pin to its neighbours, so that a bent grid is followed."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]

_REACH = 0.3
"""of the spacing: how far from its expected place a neighbour is still taken for one"""
_STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Lattice:
    """The largest connected part of a square grid."""

    points: Array
    """(N, 2) px"""
    places: NDArray[np.int64]
    """(N, 2) column, row of the grid; origin and direction are arbitrary"""
    spacing_px: float
    """median distance between neighbours"""
    strays: int
    """points given that are in no row and column"""


def find_lattice(points: Array) -> Lattice:
    """Label (N, 2) points, px, that form a square grid in any orientation, with gaps; strays are left out.

    ValueError for fewer than four points.
    """
    if len(points) < 4:
        raise ValueError(f"{len(points)} points are no grid: give at least 4")
    tree = cKDTree(points)
    spacing = float(np.median(tree.query(points, k=2)[0][:, 1]))
    along = _direction(points, tree, spacing) * spacing
    across = np.array([-along[1], along[0]])
    best: dict[tuple[int, int], int] = {}
    unseen = set(range(len(points)))
    while len(unseen) > len(best):
        # Start in the middle, where a lens bends least.
        seed = min(unseen, key=lambda i: float(np.sum((points[i] - points.mean(axis=0)) ** 2)))
        grown = _grown(seed, points, tree, np.array([along, across]))
        unseen -= {seed, *grown.values()}
        best = max(best, grown, key=len)
    chosen = np.array(list(best.values()))
    places = np.array(list(best), np.int64)
    strays = len(points) - len(chosen)
    return Lattice(points=points[chosen], places=places, spacing_px=_spacing(best, points, spacing), strays=strays)


def _spacing(found: dict[tuple[int, int], int], points: Array, otherwise: float) -> float:
    """Median distance between neighbours in the grid; `otherwise` where there are none."""
    pairs = [
        (points[i], points[found[x + dx, y + dy]])
        for (x, y), i in found.items()
        for dx, dy in _STEPS[:2]
        if (x + dx, y + dy) in found
    ]
    return float(np.median([np.linalg.norm(b - a) for a, b in pairs])) if pairs else otherwise


def _direction(points: Array, tree: cKDTree, spacing: float) -> Array:
    """Unit vector along the rows or columns: the mean direction from neighbour to neighbour, modulo 90 degrees."""
    pairs = tree.query_pairs(1.25 * spacing, output_type="ndarray")
    steps = points[pairs[:, 1]] - points[pairs[:, 0]]
    fourfold = ((steps[:, 0] + 1j * steps[:, 1]) ** 4 / spacing**4).sum()
    angle = np.angle(fourfold) / 4
    return np.array([np.cos(angle), np.sin(angle)])


def _grown(seed: int, points: Array, tree: cKDTree, basis: Array) -> dict[tuple[int, int], int]:
    """Walk from pin to pin and number them; each keeps the two grid steps (2, 2), px, measured last before it."""
    found = {(0, 0): seed}
    taken = {seed}
    queue = deque([((0, 0), basis)])
    while queue:
        place, steps = queue.popleft()
        for move in _STEPS:
            there = (place[0] + move[0], place[1] + move[1])
            step = np.array(move) @ steps
            distance, nearest = tree.query(points[found[place]] + step)
            if there in found or nearest in taken or distance > _REACH * np.linalg.norm(step):
                continue
            found[there] = int(nearest)
            taken.add(int(nearest))
            measured = steps.copy()
            axis = 0 if move[0] else 1
            measured[axis] = (points[nearest] - points[found[place]]) * (move[0] + move[1])
            # Half of the new step: a pin that is a little off its place does not lead the way astray.
            queue.append((there, (steps + measured) / 2))
    return found
