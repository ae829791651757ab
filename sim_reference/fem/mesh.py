"""The gel's mesh: a disc of tetrahedra, fine where objects are pressed, made by bisection.

Cubes are cut into six tetrahedra each (Kuhn), and these are halved again and again across one edge (Maubach, SIAM J.
Sci. Comput. 16, 1995): three halvings make eight tetrahedra of half the size and the same shapes. A tetrahedron is
halved together with all that share its edge, so the mesh stays conforming. Every new vertex is the middle of an edge,
so each coarser mesh lies inside the finer one: that is what the multigrid solver needs.

Sizes are powers of two, so that nearly every patch is whole, and the square of the size grows with the depth, by the
size at the surface a mm. Too few layers in the depth, or patches cut in part, make the gel too stiff however fine its
surface is.

The free surface is z = 0, the support z = thickness, as everywhere in GelLight (z from the gel to the camera). The rim
follows the edges of the tetrahedra: the disc's volume is right to one per cent.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
GROWTH_BESIDE = 1 / 2
"""how much larger tetrahedra become, in mm a mm beside the dense region"""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Tetrahedra of the gel at rest. Vertices are numbered from the coarsest level to the finest."""

    vertices: Array
    """(N, 3) mm"""
    tets: Indices
    """(T, 4) vertices of each tetrahedron, of positive volume"""
    patch: Indices
    """(T,) which patch a tetrahedron lies in: up to eight that were one, three halvings ago"""
    parents: Indices
    """(N, 2) the edge whose middle a vertex is; twice itself for the first level"""
    levels: tuple[int, ...]
    """how many of the vertices each level has, coarsest first; the last is N"""
    spacing_mm: float
    """between vertices of the surface in the dense region"""
    thickness_mm: float

    @cached_property
    def surface(self) -> Indices:
        """(S,) vertices of the free surface."""
        return np.unique(self.surface_triangles)

    @cached_property
    def surface_triangles(self) -> Indices:
        """(M, 3) faces of the free surface."""
        faces = np.concatenate([np.delete(self.tets, corner, axis=1) for corner in range(4)])
        return np.asarray(faces[(self.vertices[faces, 2] == 0).all(axis=1)])

    @cached_property
    def surface_area(self) -> Array:
        """(S,) mm2 of the free surface that belongs to each of its vertices: a third of the triangles around it."""
        a, b, c = (self.vertices[corner, :2] for corner in self.surface_triangles.T)
        double = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        area = np.bincount(self.surface_triangles.ravel(), np.repeat(double / 6, 3), len(self.vertices))
        return np.asarray(area[self.surface], np.float64)

    @cached_property
    def above(self) -> Indices:
        """(N,) which vertex of `surface` is nearest above each vertex."""
        return np.asarray(cKDTree(self.vertices[self.surface, :2]).query(self.vertices[:, :2])[1])

    @cached_property
    def free(self) -> Indices:
        """Vertices that may move: those of the mesh that are not bonded to the support."""
        used = np.unique(self.tets)
        return np.asarray(used[self.vertices[used, 2] < self.thickness_mm])

    @cached_property
    def prolongations(self) -> list[sp.csr_matrix]:
        """For each level but the first: the values at its vertices from those of the level before, (n, n before)."""
        return [_prolongation(self.parents, *pair) for pair in zip(self.levels, self.levels[1:], strict=False)]


def gel_mesh(geometry: SensorGeometry, resolution_mm: float, dense_radius_mm: float = 17.5) -> Mesh:
    """Return the mesh of the gel whose surface has about `resolution_mm` between vertices in the dense region.

    The nearest resolution is taken that the thickness can be divided into. Raises ValueError for one that is not
    between a thousandth and half of the thickness.
    """
    thickness = geometry.gel_thickness_mm
    if not thickness / 1000 <= resolution_mm <= thickness / 2:
        raise ValueError(
            f"resolution {resolution_mm} mm: give {thickness / 1000:g} to {thickness / 2:g} mm for a gel of "
            f"{thickness:g} mm"
        )
    layers, halvings = divisions(thickness / resolution_mm)
    radius = geometry.gel_diameter_mm / 2
    around = max(1, round(radius * layers / thickness))
    refinement = _Refinement(*_kuhn_grid(2 * around, layers, radius, thickness))
    levels = [len(refinement.vertices)]
    for halving in range(1, halvings + 1):
        size = thickness / layers / 2**halving
        refinement.refine(size, dense_radius_mm)
        levels.append(len(refinement.vertices))
    centres = refinement.vertices[refinement.tets].mean(axis=1)
    inside = np.hypot(centres[:, 0], centres[:, 1]) < radius
    return Mesh(
        vertices=refinement.vertices,
        tets=_oriented(refinement.vertices, refinement.tets[inside]),
        patch=np.unique(refinement.patch[inside], return_inverse=True)[1],
        parents=refinement.parents,
        levels=tuple(levels),
        spacing_mm=thickness / layers / 2**halvings,
        thickness_mm=thickness,
    )


def vertices_needed(geometry: SensorGeometry, resolution_mm: float, dense_radius_mm: float = 17.5) -> int:
    """Return about how many vertices `gel_mesh` makes, without making them: to a fifth from 0.6 mm down."""
    layers, halvings = divisions(geometry.gel_thickness_mm / resolution_mm)
    spacing = geometry.gel_thickness_mm / layers / 2**halvings
    return int(6 * np.pi * (dense_radius_mm / spacing) ** 2) + 1000


def divisions(wanted: float) -> tuple[int, int]:
    """Return (2 or 3, n) so that 2 or 3 times 2^n comes nearest to `wanted` layers, as a ratio."""
    choices = [(layers, halvings) for layers in (2, 3) for halvings in range(10)]
    return min(choices, key=lambda choice: abs(np.log(choice[0] * 2 ** choice[1] / wanted)))


def _kuhn_grid(across: int, layers: int, radius: float, thickness: float) -> tuple[Array, Indices]:
    """Return vertices and tetrahedra of a box of cubes, six for each cube, along its diagonal."""
    numbers = np.arange((across + 1) ** 2 * (layers + 1)).reshape(across + 1, across + 1, layers + 1)
    at = [np.linspace(-radius, radius, across + 1)] * 2 + [np.linspace(0, thickness, layers + 1)]
    vertices = np.stack(np.meshgrid(*at, indexing="ij"), axis=-1).reshape(-1, 3)
    tets = []
    for order in permutations(range(3)):
        corner, path = [0, 0, 0], []
        for axis in (None, *order):
            if axis is not None:
                corner[axis] = 1
            i, j, k = corner
            path.append(numbers[i : across + i, j : across + j, k : layers + k].ravel())
        tets.append(np.stack(path, axis=1))
    return vertices, np.concatenate(tets)


class _Refinement:
    """Tetrahedra that are being halved. The order of a tetrahedron's vertices says which edge is cut next."""

    def __init__(self, vertices: Array, tets: Indices) -> None:
        self.vertices, self.tets = vertices, tets
        self.parents = np.repeat(np.arange(len(vertices))[:, None], 2, axis=1)
        self._last = np.full(len(tets), 3)
        """the edge to cut runs from a tetrahedron's first vertex to this one: 3, 2, 1, then 3 again"""
        self.patch = np.arange(len(tets)) % (len(tets) // 6)
        self._patches = len(tets) // 6
        self._cut: dict[str, Indices] = {"edge": np.zeros(0, np.int64), "middle": np.zeros(0, np.int64)}

    def refine(self, size_mm: float, dense_radius_mm: float) -> None:
        """Halve until no tetrahedron is larger than wanted: `size_mm` at the surface of the dense region."""
        while (marked := self._too_large(size_mm, dense_radius_mm)).any():
            while marked.any():
                self._halve(marked)
                marked = self._has_cut_edge()

    def _too_large(self, size_mm: float, dense_radius_mm: float) -> NDArray[np.bool_]:
        centre = self.vertices[self.tets].mean(axis=1)
        beside = np.maximum(np.hypot(centre[:, 0], centre[:, 1]) - dense_radius_mm, 0)
        wanted = np.sqrt(size_mm**2 + size_mm * centre[:, 2]) + GROWTH_BESIDE * beside
        wanted = size_mm * 2 ** np.floor(np.log2(wanted / size_mm))
        first, last = self._ends()
        length = np.linalg.norm(self.vertices[first] - self.vertices[last], axis=1)
        # A tetrahedron of a cube's size is cut first along the cube's diagonal.
        return np.asarray(length > 1.001 * np.sqrt(3) * wanted)

    def _ends(self) -> tuple[Indices, Indices]:
        return self.tets[:, 0], self.tets[np.arange(len(self.tets)), self._last]

    def _halve(self, marked: NDArray[np.bool_]) -> None:
        tets, last = self.tets[marked], self._last[marked]
        middle = self._middles(*(end[marked] for end in self._ends()))
        rows = np.arange(len(tets))
        one, other = tets.copy(), tets.copy()
        one[rows, last] = middle
        for k in (1, 2, 3):
            of_k = last == k
            other[of_k, :k] = tets[of_k, 1 : k + 1]
        other[rows, last] = middle
        following = np.where(last > 1, last - 1, 3)
        whole = last == 3
        patch = np.where(whole, self._patches + np.cumsum(whole) - 1, self.patch[marked])
        self._patches += int(whole.sum())
        self.tets = np.concatenate([self.tets[~marked], one, other])
        self._last = np.concatenate([self._last[~marked], following, following])
        self.patch = np.concatenate([self.patch[~marked], patch, patch])

    def _middles(self, first: Indices, last: Indices) -> Indices:
        """Return the middle of each edge, a new vertex where the edge was not cut before."""
        edges = _key(first, last)
        new = np.setdiff1d(edges, self._cut["edge"])
        ends = np.stack([new >> 32, new & 0xFFFFFFFF], axis=1)
        numbers = len(self.vertices) + np.arange(len(new))
        self.vertices = np.concatenate([self.vertices, self.vertices[ends].mean(axis=1)])
        self.parents = np.concatenate([self.parents, ends])
        known = np.concatenate([self._cut["edge"], new])
        order = np.argsort(known)
        self._cut = {"edge": known[order], "middle": np.concatenate([self._cut["middle"], numbers])[order]}
        return self._cut["middle"][np.searchsorted(self._cut["edge"], edges)]

    def _has_cut_edge(self) -> NDArray[np.bool_]:
        keys = [_key(self.tets[:, a], self.tets[:, b]) for a, b in EDGES]
        return np.asarray(np.isin(keys, self._cut["edge"]).any(axis=0))


def _key(a: Indices, b: Indices) -> Indices:
    """One number for an edge, whichever end comes first."""
    return (np.minimum(a, b) << 32) | np.maximum(a, b)


def _oriented(vertices: Array, tets: Indices) -> Indices:
    """Swap two vertices where a tetrahedron's volume is negative."""
    edges = vertices[tets[:, 1:]] - vertices[tets[:, :1]]
    mirrored = np.linalg.det(edges) < 0
    tets = tets.copy()
    tets[mirrored] = tets[mirrored][:, [0, 1, 3, 2]]
    return tets


def _prolongation(parents: Indices, coarse: int, fine: int) -> sp.csr_matrix:
    """A new vertex has the mean of its two parents, which may be new themselves: substitute until all are old."""
    rows = np.repeat(np.arange(coarse, fine) - coarse, 2)
    mean = sp.csr_matrix((np.full(len(rows), 0.5), (rows, parents[coarse:fine].ravel())), (fine - coarse, fine))
    of_old, of_new = mean[:, :coarse], mean[:, coarse:]
    total = of_old
    while of_old.nnz:
        of_old = of_new @ of_old
        total = total + of_old
    return sp.vstack([sp.identity(coarse, format="csr"), total], format="csr")
