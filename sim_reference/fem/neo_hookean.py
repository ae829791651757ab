"""The elastic energy of the gel: a compressible Neo-Hookean solid, in units of its shear modulus times mm3.

    W = sum over tetrahedra of V ((|F|^2 - 3) / 2 - log det F + own/2 (log det F)^2)
        + sum over patches of V (lambda - own)/2 (log J)^2

F is the deformation gradient of a tetrahedron, V a volume at rest, lambda = 2 nu / (1 - 2 nu), and J is how many times
its volume at rest a patch has. A linear tetrahedron alone cannot bend without changing its volume: with all of lambda
on each tetrahedron's own det F, a nearly incompressible gel locks (test_fem_gel.py measures it). A patch is up to eight
tetrahedra that were one before three halvings (`mesh.Mesh.patch`), and holds their common volume. With all of lambda on
patches, single tetrahedra collapse under steep walls, to a tenth of their volume and less. So each holds its own volume
with `own`, one shear modulus (as Puso and Solberg stabilise nodal integration, IJNME 67, 2006).

With b_a = F^-T grad N_a, the gradient of corner a's shape function in the deformed tetrahedron, d(det F)/dx_a is
det F b_a, and all below follows from that. Sums over the mesh are made in `assembly`.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sim_reference.fem.matrices import cofactors, determinant, eigenvectors, inner, product, transposed
from sim_reference.fem.mesh import Indices, Mesh

Array = NDArray[np.float64]
PATCH_CORNERS = 10
"""a tetrahedron has four corners and the middles of six edges; a cube of the first level has eight corners"""
OWN_MODULUS = 1.0
"""shear moduli: what of lambda each tetrahedron has itself. More locks, less lets tetrahedra collapse"""
AT_ONCE = 8192
"""tetrahedra: with fewer NumPy's calls weigh more than what they do, with more the processor's cache is left"""


@dataclass(frozen=True, eq=False)
class Strain:
    """What the energy and its derivatives need to know of every tetrahedron and patch."""

    gradient: Array
    """(3, 3, T) F"""
    cofactors: Array
    """(3, 3, T) det F times the inverse of F, transposed"""
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
        lame = 2 * poisson_ratio / (1 - 2 * poisson_ratio)
        self.own = min(lame, OWN_MODULUS)
        self.of_patch = lame - self.own
        self.tets = np.sort(mesh.tets, axis=1)
        """(T, 4) in ascending order"""
        self.patch = mesh.patch if patches else np.arange(len(mesh.tets))
        edges = _edges(mesh.vertices, self.tets)
        of_others = cofactors(edges) / determinant(edges)
        self.shape_gradient = np.concatenate([-of_others.sum(axis=1, keepdims=True), of_others], axis=1)
        """(3, 4, T) grad N_a"""
        self.volume = np.abs(determinant(edges)) / 6
        """(T,) mm3"""
        self.patch_volume = np.bincount(self.patch, self.volume)
        self.patch_vertices, self._slot = patch_corners(self.tets, self.patch)
        # Memory that is new to the process costs more than what is done with it: each Hessian has the same.
        self._tet_shares = np.empty((3, 3, len(pairs(4)), len(self.tets)))
        self._patch_shares = np.empty((3, 3, len(pairs(PATCH_CORNERS)), len(self.patch_volume)))
        self._last: tuple[Array, Strain] | None = None

    def strain(self, at: Array) -> Strain:
        """Return the strain with the vertices `at` (N, 3); the last one is kept, for all of a step asks for it."""
        if self._last is None or not np.array_equal(at, self._last[0]):
            self._last = at.copy(), self._strain(at)
        return self._last[1]

    def _strain(self, at: Array) -> Strain:
        gradient = self.deformation(at)
        cofactor = cofactors(gradient)
        ratio = np.asarray((gradient[0] * cofactor[0]).sum(axis=0))
        return Strain(gradient, cofactor, ratio, np.bincount(self.patch, self.volume * ratio) / self.patch_volume)

    def deformation(self, at: Array) -> Array:
        """Return F (3, 3, T), which is linear in `at` (N, 3)."""
        return product(_edges(at, self.tets), transposed(self.shape_gradient[:, 1:]))

    def value(self, at: Array) -> float:
        """Return W; infinite where a tetrahedron is inverted."""
        strain = self.strain(at)
        if not (strain.volume_ratio > 0).all():
            return np.inf
        log = np.log(strain.volume_ratio)
        distortion = inner(strain.gradient, strain.gradient) - 3 - 2 * log + self.own * log**2
        dilatation = self.of_patch * np.log(strain.patch_ratio) ** 2
        return float(self.volume @ distortion + self.patch_volume @ dilatation) / 2

    def gradient(self, at: Array) -> Array:
        """Return dW/dx (N, 3), to which each tetrahedron adds V (F + (q - 1) F^-T) grad N_a."""
        strain = self.strain(at)
        stress = strain.gradient + (self._tension(strain) - 1) / strain.volume_ratio * strain.cofactors
        shares = product(self.volume * stress, self.shape_gradient)
        corners = self.tets.T.ravel()
        return np.stack([np.bincount(corners, share.ravel(), len(at)) for share in shares], axis=1)

    def hessians(self, at: Array, *, project: bool) -> tuple[Array, Array]:
        """Return the shares of d2W/dx_a dx_b for pairs a < b of corners: of tetrahedra (3, 3, 6, T), and of patches.

        Tetrahedron, with c = own (1 - log det F): V ((grad N_a . grad N_b) I + (q + c) b_a b_b^T + (1 - q) b_b b_a^T).
        Patch, (3, 3, 45, P): V w'' (dJ/dx_a) (dJ/dx_b)^T with w = (lambda - own)/2 (log J)^2. `project` makes each
        positive semidefinite. Moving all corners alike costs nothing, so the pairs also give the shares of a = b
        (`assembly`). The next call overwrites the arrays.
        """
        strain = self.strain(at)
        tension, spatial = self._tension(strain), np.empty_like(self.shape_gradient)
        for begin in range(0, len(self.tets), AT_ONCE):
            now = slice(begin, begin + AT_ONCE)
            of_corners, volume, q = self.shape_gradient[..., now], self.volume[now], tension[now]
            spatial[..., now] = product(strain.cofactors[..., now], of_corners) / strain.volume_ratio[now]
            bulk = self.own * (1 - np.log(strain.volume_ratio[now]))
            found = _tet_hessians(of_corners, spatial[..., now], q, bulk)
            if project:
                found += _lift(strain.gradient[..., now], q, bulk, of_corners)
            np.multiply(volume, found, out=self._tet_shares[..., now])
        return self._tet_shares, self._patch_hessians(strain, spatial, project=project)

    def _patch_hessians(self, strain: Strain, spatial: Array, *, project: bool) -> Array:
        patches, ratio = len(self.patch_volume), strain.patch_ratio
        shares = self.volume * strain.volume_ratio / self.patch_volume[self.patch] * spatial
        change = np.stack([np.bincount(self._slot, share.ravel(), PATCH_CORNERS * patches) for share in shares])
        change = change.reshape(3, PATCH_CORNERS, patches)
        curvature = self.of_patch * (1 - np.log(ratio)) / ratio**2
        weighed = self.patch_volume * (np.maximum(curvature, 0) if project else curvature) * change
        for pair, (a, b) in enumerate(pairs(PATCH_CORNERS)):
            np.multiply(weighed[:, None, a], change[None, :, b], out=self._patch_shares[:, :, pair])
        return self._patch_shares

    def _tension(self, strain: Strain) -> Array:
        """(T,) q = w'(J) det F + own log det F, the tension that keeps the volume: negative in compression."""
        ratio = strain.patch_ratio
        of_patch = (self.of_patch * np.log(ratio) / ratio)[self.patch] * strain.volume_ratio
        return np.asarray(of_patch + self.own * np.log(strain.volume_ratio))


def pairs(corners: int) -> list[tuple[int, int]]:
    """Return all pairs a < b of corners, in the order of the shares."""
    return list(combinations(range(corners), 2))


def _edges(at: Array, tets: Indices) -> Array:
    """(3, 3, T): from a tetrahedron's first corner to the others, as columns."""
    corners = np.stack([axis[tets.T] for axis in np.ascontiguousarray(at.T)])
    return np.asarray(corners[:, 1:] - corners[:, :1])


def patch_corners(tets: Indices, patch: Indices) -> tuple[Indices, Indices]:
    """Return the vertices of each patch (P, 10), ascending, then -1, and where in (10, P) each corner of (4, T) is."""
    count = int(patch.max()) + 1
    keys = (patch[:, None] * (tets.max() + 1) + tets).T.ravel()
    unique, place = np.unique(keys, return_inverse=True)
    of_patch, vertex = np.divmod(unique, tets.max() + 1)
    begins = np.searchsorted(of_patch, np.arange(count))
    corner = np.arange(len(unique)) - begins[of_patch]
    vertices = np.full((count, PATCH_CORNERS), -1)
    vertices[of_patch, corner] = vertex
    return vertices, (corner * count + of_patch)[place]


def _tet_hessians(shape_gradient: Array, spatial: Array, tension: Array, bulk: Array) -> Array:
    """Return (grad N_a . grad N_b) I + (q + c) b_a b_b^T + (1 - q) b_b b_a^T of all pairs, (3, 3, 6, T)."""
    first, second = np.transpose(pairs(4))
    b_a, b_b = spatial[:, first], spatial[:, second]
    result = ((tension + bulk) * b_a)[:, None] * b_b[None]
    result += ((1 - tension) * b_b)[:, None] * b_a[None]
    along = (shape_gradient[:, first] * shape_gradient[:, second]).sum(axis=0)
    for axis in range(3):
        result[axis, axis] += along
    return np.asarray(result)


def _lift(gradient: Array, tension: Array, bulk: Array, shape_gradient: Array) -> Array:
    """Return what makes the negative eigenvalues of each tetrahedron's Hessian 0, for all pairs (3, 3, 6, T).

    In the frame of F = U diag(s) V^T the nine eigenmatrices E of d2W/dF2 are known: three stretches U diag(e) V^T with
    e from a 3 x 3 matrix, and for each pair k, m of axes a shear and a twist with 1 +- (1 - q) / (s_k s_m). A lift of l
    adds l (E grad N_a) (E grad N_b)^T.
    """
    squares, right = eigenvectors(product(transposed(gradient), gradient))
    s = np.sqrt(squares)
    left = product(gradient, right) / s
    across = product(transposed(right), shape_gradient)
    k, m = [1, 2, 0], [2, 0, 1]
    coupling = (1 - tension) / (s[k] * s[m])
    one, other = left[:, k, None] * across[m], left[:, m, None] * across[k]
    result = _raised(np.maximum(coupling - 1, 0) / 2, one - other)
    shears, (stretches, axes) = np.maximum(-1 - coupling, 0) / 2, _stretch_lifts(s, tension, bulk)
    rare = np.flatnonzero((shears + stretches).any(axis=0))
    stretched = product(left[:, :, None, rare], axes[:, :, None, rare] * across[:, None, :, rare])
    result[..., rare] += _raised(shears[:, rare], (one + other)[..., rare]) + _raised(stretches[:, rare], stretched)
    return result


def _raised(lifts: Array, moves: Array) -> Array:
    """Return the sum of `lifts` (3, T) times the outer products of `moves` (3, 3, 4, T) of all pairs (3, 3, 6, T)."""
    lifted, pair = lifts[:, None] * moves, 0
    result = np.empty((3, 3, len(pairs(4)), lifts.shape[-1]))
    # Row by row, what is in between stays in the processor's cache.
    for a in range(3):
        following = slice(pair, pair := pair + 3 - a)
        for row in range(3):
            np.multiply(lifted[row, 0, a], moves[:, 0, a + 1 :], out=result[row, :, following])
            for mode in (1, 2):
                result[row, :, following] += lifted[row, mode, a] * moves[:, mode, a + 1 :]
    return result


def _stretch_lifts(s: Array, tension: Array, bulk: Array) -> tuple[Array, Array]:
    """Return the lifts (3, T) of the three stretches, and each one's e as columns (3, 3, T)."""
    matrix = (tension + bulk) / (s[:, None] * s[None])
    for axis in range(3):
        matrix[axis, axis] = 1 + (1 + bulk) / s[axis] ** 2
    lifts, axes = np.zeros_like(s), np.zeros_like(matrix)
    # Where the diagonal outweighs the rest, no eigenvalue is negative (Gershgorin).
    rest = np.abs(matrix).sum(axis=1) - np.abs(np.einsum("iit->it", matrix))
    at = np.flatnonzero((rest > np.einsum("iit->it", matrix)).any(axis=0))
    values, axes[..., at] = eigenvectors(matrix[..., at])
    lifts[:, at] = np.maximum(-values, 0)
    return lifts, axes
