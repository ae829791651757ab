"""The elastic energy of the gel: a compressible Neo-Hookean solid, in units of its shear modulus times mm3.

    W = sum over tetrahedra of V (|F|^2 - 3 - 2 log det F) / 2  +  sum over patches of V lambda/2 (log J)^2

F is the deformation gradient of a tetrahedron, V a volume at rest, lambda = 2 nu / (1 - 2 nu), and J is how many times
its volume at rest a patch has. A linear tetrahedron alone cannot bend without changing its volume: with each
tetrahedron's own det F in place of J, a nearly incompressible gel locks (test_fem_gel.py measures it). A patch is up to
eight tetrahedra that were one before three halvings (`mesh.Mesh.patch`); only their common volume is kept.

With b_a = F^-T grad N_a, the gradient of corner a's shape function in the deformed tetrahedron, d(det F)/dx_a is
det F b_a, and all below follows from that. Sums over the mesh are made in `assembly`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_reference.fem.assembly import scattered
from sim_reference.fem.mesh import Indices, Mesh

Array = NDArray[np.float64]
PATCH_CORNERS = 10
"""a tetrahedron has four corners and the middles of six edges; a cube of the first level has eight corners"""


@dataclass(frozen=True, eq=False)
class Strain:
    """What the energy and its derivatives need to know of every tetrahedron and patch."""

    gradient: Array
    """(T, 3, 3) F"""
    volume_ratio: Array
    """(T,) det F; not above 0 where a tetrahedron is inverted"""
    patch_ratio: Array
    """(P,) J"""


class NeoHookean:
    """The energy of one mesh, and its derivatives by vertex positions (N, 3) mm."""

    def __init__(self, mesh: Mesh, poisson_ratio: float, *, patches: bool = True) -> None:
        """Prepare the constants of `mesh`; `patches=False` keeps each tetrahedron's own volume, which locks.

        Raises ValueError for a Poisson's ratio outside [0, 0.5).
        """
        if not 0 <= poisson_ratio < 0.5:
            raise ValueError(f"Poisson's ratio {poisson_ratio}: give 0 to below 0.5, 0.499 is the nearest that works")
        self.lame = 2 * poisson_ratio / (1 - 2 * poisson_ratio)
        self.tets = mesh.tets
        self.patch = mesh.patch if patches else np.arange(len(mesh.tets))
        edges = np.swapaxes(mesh.vertices[mesh.tets[:, 1:]] - mesh.vertices[mesh.tets[:, :1]], 1, 2)
        of_others = np.linalg.inv(edges)
        self.shape_gradient = np.concatenate([-of_others.sum(axis=1, keepdims=True), of_others], axis=1)
        """(T, 4, 3) grad N_a"""
        self.volume = np.linalg.det(edges) / 6
        """(T,) mm3"""
        self.patch_volume = np.bincount(self.patch, self.volume)
        self.patch_vertices, self._slot = patch_corners(self.tets, self.patch)

    def strain(self, at: Array) -> Strain:
        """Return the strain with the vertices `at` (N, 3)."""
        gradient = np.swapaxes(at[self.tets], 1, 2) @ self.shape_gradient
        ratio = np.linalg.det(gradient)
        return Strain(gradient, ratio, np.bincount(self.patch, self.volume * ratio) / self.patch_volume)

    def value(self, at: Array) -> float:
        """Return W; infinite where a tetrahedron is inverted."""
        strain = self.strain(at)
        if not (strain.volume_ratio > 0).all():
            return np.inf
        distortion = (strain.gradient**2).sum(axis=(1, 2)) - 3 - 2 * np.log(strain.volume_ratio)
        dilatation = self.lame * np.log(strain.patch_ratio) ** 2
        return float(self.volume @ distortion + self.patch_volume @ dilatation) / 2

    def gradients(self, at: Array) -> Array:
        """Return each tetrahedron's share of dW/dx, (T, 4, 3): V (F grad N_a + (q - 1) b_a)."""
        strain = self.strain(at)
        stretch = self.shape_gradient @ np.swapaxes(strain.gradient, 1, 2)
        spatial = self._spatial(strain)
        return np.asarray(self.volume[:, None, None] * (stretch + (self._tension(strain) - 1)[:, None, None] * spatial))

    def hessians(self, at: Array, *, project: bool) -> tuple[Array, Array]:
        """Return the shares of d2W/dx2 of tetrahedra (T, 4, 4, 3, 3) and of patches (P, 10, 10, 3, 3).

        Tetrahedron: V ((grad N_a . grad N_b) I + q b_a b_b^T + (1 - q) b_b b_a^T). Patch: V w'' (dJ/dx_a) (dJ/dx_b)^T
        with w = lambda/2 (log J)^2. `project` makes each positive semidefinite.
        """
        strain = self.strain(at)
        spatial, tension = self._spatial(strain), self._tension(strain)
        along = self.shape_gradient @ np.swapaxes(self.shape_gradient, 1, 2)
        outer = spatial[:, :, None, :, None] * spatial[:, None, :, None, :]
        tets = tension[:, None, None, None, None] * outer
        tets += (1 - tension)[:, None, None, None, None] * np.swapaxes(outer, 3, 4)
        for axis in range(3):
            tets[..., axis, axis] += along
        if project:
            _lift(tets, strain.gradient, tension, self.shape_gradient)
        tets *= self.volume[:, None, None, None, None]
        return tets, self._patch_hessians(strain, spatial, project=project)

    def _patch_hessians(self, strain: Strain, spatial: Array, *, project: bool) -> Array:
        patches, ratio = len(self.patch_volume), strain.patch_ratio
        share = (self.volume * strain.volume_ratio)[:, None, None] * spatial / self.patch_volume[self.patch, None, None]
        change = scattered(self._slot, share, patches * PATCH_CORNERS).reshape(patches, PATCH_CORNERS, 3)
        curvature = self.lame * (1 - np.log(ratio)) / ratio**2
        weight = self.patch_volume * (np.maximum(curvature, 0) if project else curvature)
        return np.asarray((weight[:, None, None] * change)[:, :, None, :, None] * change[:, None, :, None, :])

    def _spatial(self, strain: Strain) -> Array:
        """(T, 4, 3) b_a = F^-T grad N_a."""
        return np.asarray(self.shape_gradient @ np.linalg.inv(strain.gradient))

    def _tension(self, strain: Strain) -> Array:
        """(T,) q = w'(J) det F, the tension that keeps the volume: negative in compression."""
        ratio = strain.patch_ratio
        return np.asarray((self.lame * np.log(ratio) / ratio)[self.patch] * strain.volume_ratio)


def patch_corners(tets: Indices, patch: Indices) -> tuple[Indices, Indices]:
    """Return the vertices of each patch (P, 10), -1 where it has fewer, and each corner's place among all (T, 4)."""
    pairs = patch[:, None] * (tets.max() + 1) + tets
    unique, place = np.unique(pairs, return_inverse=True)
    of_patch, vertex = np.divmod(unique, tets.max() + 1)
    begins = np.searchsorted(of_patch, np.arange(patch.max() + 1))
    slot = of_patch * PATCH_CORNERS + np.arange(len(unique)) - begins[of_patch]
    vertices = np.full((patch.max() + 1) * PATCH_CORNERS, -1)
    vertices[slot] = vertex
    return vertices.reshape(-1, PATCH_CORNERS), slot[place].reshape(tets.shape)


def _lift(hessians: Array, gradient: Array, tension: Array, shape_gradient: Array) -> None:
    """Add to each tetrahedron's Hessian what makes its negative eigenvalues 0.

    In the frame of F = U diag(s) V^T the nine eigenmatrices of d2W/dF2 are known: three stretches U diag(e) V^T with e
    from a 3 x 3 matrix, and for each pair k, m of axes a shear and a twist with 1 +- (1 - q) / (s_k s_m).
    """
    squares, right = np.linalg.eigh(np.swapaxes(gradient, 1, 2) @ gradient)
    s = np.sqrt(squares)
    left = gradient @ right / s[:, None, :]
    stretch = tension[:, None, None] / (s[:, :, None] * s[:, None, :])
    diagonal = np.arange(3)
    stretch[:, diagonal, diagonal] = 1 + 1 / squares
    values, axes = np.linalg.eigh(stretch)
    for mode in range(3):
        matrix = (left * axes[:, None, :, mode]) @ np.swapaxes(right, 1, 2)
        _add_mode(hessians, -values[:, mode], matrix, shape_gradient)
    for k, m in ((0, 1), (1, 2), (0, 2)):
        coupling = (1 - tension) / (s[:, k] * s[:, m])
        one = left[:, :, None, k] * right[:, None, :, m]
        other = left[:, :, None, m] * right[:, None, :, k]
        _add_mode(hessians, -(1 + coupling), (one + other) / np.sqrt(2), shape_gradient)
        _add_mode(hessians, -(1 - coupling), (one - other) / np.sqrt(2), shape_gradient)


def _add_mode(hessians: Array, amount: Array, matrix: Array, shape_gradient: Array) -> None:
    """Add amount (M grad N_a) (M grad N_b)^T where `amount` is positive."""
    at = np.flatnonzero(amount > 0)
    moved = shape_gradient[at] @ np.swapaxes(matrix[at], 1, 2)
    hessians[at] += (amount[at, None, None] * moved)[:, :, None, :, None] * moved[:, None, :, None, :]
