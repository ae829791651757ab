"""The pressed object as an affine body (Lan et al., Affine Body Dynamics, ACM TOG 41, 2022), at rest under a load.

A point X of the object lies at x = P + c + A (X - P): 12 unknowns q, the movement c of the load's point P, then A by
rows. The energy of the object is

    E = kappaV ||A A^T - I||^2 - F c_z

kappaV is so large that A stays a rotation. The barrier is that of the object's own frame, where the gel's vertex x is
at X = P + A^-1 (x - P - c); its derivatives by x and q follow from dX = A^-1 (dx - dc - dA (X - P)) and
d2X = -2 A^-1 dA dX. In units of the shear modulus times mm3.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_reference.fem.barrier import Barrier, semidefinite
from sim_reference.fem.multigrid import Solution

Array = NDArray[np.float64]
RIGIDITY = 1e6
"""kappaV, shear moduli times mm3: about that of 700 mm3 of hard plastic (100 MPa) on the default gel"""
UNKNOWNS = 12
DOWN = 2
"""place of c_z in q"""
RIGID_MOVES = 3
"""the first of a load's moves, as far as it leaves them free: sinking and two tilts"""


@dataclass(frozen=True)
class Load:
    """A force along z, at a joint that slides along z and does not turn about it."""

    force: float
    """shear moduli times mm2"""
    at_mm: tuple[float, float] = (0.0, 0.0)
    """x, y of P, which lies level with the object's highest point"""
    tilts: bool = False
    """false: the object moves along z alone"""

    def moves(self, matrix: Array) -> Array:
        """Return the changes of q (12, k) that the joint leaves free: sinking, then two tilts and six strains of A."""
        sink = np.eye(UNKNOWNS)[:, DOWN : DOWN + 1]
        if not self.tilts:
            return sink
        changes = np.stack([change @ matrix for change in _tilts_and_strains()])
        return np.concatenate([sink, np.concatenate([np.zeros((len(changes), 3)), changes.reshape(-1, 9)], 1).T], 1)

    def value(self, depth_mm: float, matrix: Array) -> float:
        """Return E."""
        return RIGIDITY * float((_strain(matrix) ** 2).sum()) - self.force * depth_mm

    def gradient(self, matrix: Array) -> Array:
        """Return dE/dq (12,): -F for c_z, 4 kappaV (A A^T - I) A for A."""
        by_matrix = 4 * RIGIDITY * _strain(matrix) @ matrix
        return np.concatenate([[0, 0, -self.force], by_matrix.ravel()])

    def hessian(self, matrix: Array, *, project: bool) -> Array:
        """Return d2E/dq2 (12, 12): 4 kappaV ((dA A^T + A dA^T) A + (A A^T - I) dA), semidefinite if `project`."""
        changes = np.eye(9).reshape(9, 3, 3)
        stretched = changes @ matrix.T + matrix @ changes.swapaxes(1, 2)
        block = 4 * RIGIDITY * (stretched @ matrix + _strain(matrix) @ changes).reshape(9, 9)
        result = np.zeros((UNKNOWNS, UNKNOWNS))
        result[3:, 3:] = semidefinite(block[None])[0] if project else block
        return result


@dataclass(frozen=True, eq=False)
class Border:
    """Derivatives of the energy of barrier and load by q, reduced to the k moves that the load leaves free."""

    moves: Array
    """(12, k)"""
    gradient: Array
    """(k,)"""
    hessian: Array
    """(k, k)"""
    coupling: Array
    """(3n, k) second derivative by the n free vertices of the gel and the moves"""

    def solve(self, of_gel: Solution, solve: Callable[[Array], Solution]) -> tuple[Solution, Array]:
        """Return Newton's step of the gel and of q (12,), by elimination of the gel (Schur complement).

        `of_gel` is the gel's step under a held object, `solve` solves its linear system. How the gel follows the
        strains of A is left out: beside kappaV it is some ten-thousandths. The solution is not convex where the energy
        of both together is not.
        """
        along = [solve(column) for column in self.coupling.T[:RIGID_MOVES]]
        rigid, followed = len(along), np.stack([one.vector for one in along], axis=1)
        schur, softer = self.hessian.copy(), followed.T @ self.coupling
        schur[:rigid] -= softer
        schur[rigid:, :rigid] -= softer[:, rigid:].T
        shares = -np.linalg.solve(schur, self.gradient + self.coupling.T @ of_gel.vector)
        convex = all(one.convex for one in [of_gel, *along])
        convex = convex and float(np.linalg.eigvalsh((schur + schur.T) / 2)[0]) > 0
        iterations = of_gel.iterations + sum(one.iterations for one in along)
        return Solution(of_gel.vector - followed @ shares[:rigid], iterations, convex), self.moves @ shares


def border(barrier: Barrier, load: Load, at: Array, spread: Callable[[Array], Array], *, project: bool) -> Border:
    """Return the border of Newton's system with the surface `at` (S, 3).

    `spread` turns (S, 3, k) into (3n, k). `project` leaves d2X out: the contact's part of the border and of the gel
    together is then semidefinite.
    """
    moves = load.moves(barrier.matrix)
    hessian, coupling = hessians_by_object(barrier, at, project=project)
    hessian += load.hessian(barrier.matrix, project=project)
    gradient = gradient_by_object(barrier, at) + load.gradient(barrier.matrix)
    return Border(moves, gradient @ moves, moves.T @ hessian @ moves, spread(coupling @ moves))


def gradient_by_object(barrier: Barrier, at: Array) -> Array:
    """Return dB/dq (12,) of the barrier with the surface `at` (S, 3)."""
    force = barrier.gradient(at)
    near = np.flatnonzero(force.any(axis=1))
    return -np.asarray(np.einsum("siq,si->q", _carried(barrier, at[near]), force[near]))


def hessians_by_object(barrier: Barrier, at: Array, *, project: bool) -> tuple[Array, Array]:
    """Return d2B/dq2 (12, 12) and d2B/dx dq (S, 3, 12) of the barrier, without d2X if `project`."""
    force = barrier.gradient(at)
    near = np.flatnonzero(force.any(axis=1))
    carried = _carried(barrier, at[near])
    coupling = -barrier.hessian(at, project=project)[near] @ carried
    hessian = -np.einsum("siq,sir->qr", carried, coupling)
    if not project:
        turning = _turning(force[near]) @ np.linalg.inv(barrier.matrix)
        coupling -= turning.swapaxes(1, 2)
        twist = np.einsum("sqi,sir->qr", turning, carried)
        hessian += twist + twist.T
    everywhere = np.zeros((len(at), 3, UNKNOWNS))
    everywhere[near] = coupling
    return hessian, everywhere


def rotation(slopes: Array) -> Array:
    """Return the rotation (3, 3) about a level axis that gives a level plane the slopes (2,) dz/dx, dz/dy."""
    normal = np.array([-slopes[0], -slopes[1], 1.0])
    normal /= np.linalg.norm(normal)
    across = np.outer(normal, [0.0, 0.0, 1.0])
    skew = across - across.T
    return np.asarray(np.eye(3) + skew + skew @ skew / (1 + normal[2]))


def _carried(barrier: Barrier, at: Array) -> Array:
    """Return (S, 3, 12): how the object moves by q where the vertices are, dc + dA (X - P)."""
    arm = barrier.local(at) - barrier.pivot
    by_matrix = np.einsum("ik,sj->sikj", np.eye(3), arm).reshape(len(arm), 3, 9)
    return np.concatenate([np.broadcast_to(np.eye(3), (len(arm), 3, 3)), by_matrix], axis=2)


def _turning(force: Array) -> Array:
    """Return (S, 12, 3): n dA w as a form of q and w."""
    by_matrix = np.einsum("si,jk->sijk", force, np.eye(3)).reshape(len(force), 9, 3)
    return np.concatenate([np.zeros((len(force), 3, 3)), by_matrix], axis=1)


def _strain(matrix: Array) -> Array:
    return np.asarray(matrix @ matrix.T - np.eye(3))


def _tilts_and_strains() -> list[Array]:
    """Return the antisymmetric matrices about x and y, and the six symmetric ones."""
    unit = np.eye(9).reshape(3, 3, 3, 3)
    tilts = [unit[2, 1] - unit[1, 2], unit[0, 2] - unit[2, 0]]
    return tilts + [unit[i, j] + unit[j, i] for i in range(3) for j in range(i, 3)]


def tilt_rad(matrix: Array) -> float:
    """Return the angle between the object's z axis and z."""
    return float(np.arctan2(np.hypot(*matrix[:2, 2]), matrix[2, 2]))
