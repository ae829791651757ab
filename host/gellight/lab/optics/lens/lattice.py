"""Which row and column of the grid each pin is in: from one pin to its neighbours, so that a bent grid is followed.

Such a grid also tells the view of a gel that is seen from the side.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gellight.base.errors import InputError
from gellight.frames.view import View
from gellight.lab.optics.lens.pins import Floats, find_pins, spots

Array = NDArray[np.float64]

_REACH = 0.3
"""of the spacing: how far from its expected place a neighbour is still taken for one"""
_STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))  # right, down, left, up
LEAST_POINTS = 9  # chosen: a grid of 3 x 3, as docs/your-images.md promises
_LARGEST_MISS = 0.15
"""of the spacing: a grid whose points lie farther from where the view puts them is no square grid, or was misread"""


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


def best_lattice(contrasts: Sequence[Floats], spacing_px: float) -> tuple[Lattice | None, int]:
    """Return the grid of most points in any of some (H, W) pictures, and how many spots there are at most.

    None for fewer than `LEAST_POINTS` in a grid. spacing_px: about, of two neighbours.
    """
    spots = [find_pins(contrast, spacing_px) for contrast in contrasts]
    found = [find_lattice(points) for points in spots if len(points) >= LEAST_POINTS]
    best = max(found, key=lambda lattice: len(lattice.points), default=None)
    enough = best is not None and len(best.points) >= LEAST_POINTS
    return best if enough else None, max(len(points) for points in spots)


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


def view_of_grid(image: NDArray[np.uint8], spacing_px: float, pitch_mm: float, pixel_size_mm: float) -> View:
    """Return the view in which the grid in a (H, W, 3) picture is square, with half a pitch around it.

    spacing_px: of two neighbours in the picture, roughly. Raises InputError where no grid is found.
    """
    lattice, _ = best_lattice(spots(image.astype(np.float32), spacing_px), spacing_px)
    if lattice is None or np.ptp(lattice.places, axis=0).min() < 2:
        raise InputError(
            f"no grid of at least 3 x 3 points, about {spacing_px:g} px apart, was found: give their distance in px, "
            "or the four corners of the view"
        )
    wide = pitch_mm / pixel_size_mm
    first = lattice.places.min(axis=0)
    wanted = (lattice.places - first + 0.5) * wide - 0.5
    columns, rows = (np.ptp(lattice.places, axis=0) + 1).tolist()
    shape = (round(rows * wide), round(columns * wide))
    view = View.of_points(lattice.points, wanted, (image.shape[0], image.shape[1]), shape)
    miss = float(np.sqrt(((view.places(lattice.points) - wanted) ** 2).sum(axis=1).mean()))
    if miss > _LARGEST_MISS * wide:
        raise InputError(
            f"the {len(lattice.points)} points found miss a square grid by {miss:.1f} px: give the distance of "
            "neighbours in px more exactly, or the four corners of the view"
        )
    return view
