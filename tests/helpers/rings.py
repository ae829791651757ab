"""The gel under a ball by rings: another finite-element method, which judges the tetrahedra of `sim_reference.fem`.

A ball on a layer is the same all around its axis, so a section through it is enough: quadrilaterals of nine nodes, 0.2
mm at the contact, with the same Neo-Hookean law, in shear moduli. The ball presses by a penalty at the points of
integration, so nothing depends on where the nodes lie. Forces change by 0.0002 of themselves from 0.2 to 0.1 mm.
"""

from itertools import product

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
FINE_MM, NEAR_MM, GROWTH = 0.2, 2.0, 1.15
"""size where the ball touches, how far that goes, and how much larger each ring is than the last beyond"""
PENALTY = 1000.0
"""shear moduli per mm: a pressure of one shear modulus leaves 1 um"""
INCREMENT_MM, LONGEST_MM = 0.025, 0.02
"""of the press, and of a step of Newton's method"""
GAUSS = tuple(zip(*(np.polynomial.legendre.leggauss(3)), strict=True))
AT_EDGE = tuple(zip(*(np.polynomial.legendre.leggauss(5)), strict=True))
UPRIGHT = np.array([1.0, 0.0, 0.0, 1.0, 1.0])
"""F at rest: rr, rz, zr, zz, and around the axis"""


class Rings:
    """The section of a round gel that is bonded to its support at z = thickness."""

    def __init__(self, radius_mm: float, thickness_mm: float, poisson_ratio: float) -> None:
        self.lame = 2 * poisson_ratio / (1 - 2 * poisson_ratio)
        r, z = _graded(NEAR_MM, radius_mm), _graded(FINE_MM, thickness_mm)
        numbers = np.arange(len(r) * len(z)).reshape(len(r), len(z))
        self.rest = np.stack(np.meshgrid(r, z, indexing="ij"), axis=-1).reshape(-1, 2)
        first = product(range(0, len(r) - 1, 2), range(0, len(z) - 1, 2))
        self.unknowns = _of_nodes(np.array([numbers[i : i + 3, j : j + 3].ravel() for i, j in first]))
        self.edges = np.array([numbers[i : i + 3, 0] for i in range(0, len(r) - 1, 2)])
        held = np.stack([(self.rest[:, 1] == thickness_mm) | (self.rest[:, 0] == 0), self.rest[:, 1] == thickness_mm])
        self.free = np.flatnonzero(~held.T.ravel())
        self.points = [self._point(a, b, by_a * by_b) for (a, by_a), (b, by_b) in product(GAUSS, GAUSS)]

    def _point(self, across: float, down: float, weight: float) -> tuple[Array, Array]:
        """Return, for each ring, F - F at rest (5, 18) from the moves of its nodes, and the volume, of one point."""
        (a, by_a), (b, by_b) = _quadratic(across), _quadratic(down)
        shape, slopes = np.outer(a, b).ravel(), np.stack([np.outer(by_a, b).ravel(), np.outer(a, by_b).ravel()])
        corners = self.rest[self.unknowns[:, ::2] // 2]
        jacobian = np.einsum("ka,eai->eki", slopes, corners)
        gradient = np.einsum("eik,ka->eia", np.linalg.inv(jacobian), slopes)
        radius = corners[:, :, 0] @ shape
        strain = np.zeros((len(corners), 5, 18))
        strain[:, 0:2, 0::2] = strain[:, 2:4, 1::2] = gradient
        strain[:, 4, 0::2] = shape / radius[:, None]
        return strain, weight * np.linalg.det(jacobian) * 2 * np.pi * radius

    def elastic(self, moves: Array) -> tuple[Array, Array]:
        """Return the gradient of the energy (n,), and its second derivative by the nodes of each ring (E, 18, 18)."""
        force, blocks = np.zeros(len(moves)), np.zeros((len(self.unknowns), 18, 18))
        for strain, volume in self.points:
            stress, stiffness = self._law(UPRIGHT + np.einsum("eij,ej->ei", strain, moves[self.unknowns]))
            np.add.at(force, self.unknowns, np.einsum("eij,ei,e->ej", strain, stress, volume))
            blocks += np.swapaxes(strain, 1, 2) @ (volume[:, None, None] * stiffness) @ strain
        return force, blocks

    def _law(self, gradient: Array) -> tuple[Array, Array]:
        """Return dW/dF (E, 5) and d2W/dF2 of W = (|F|^2 - 3) / 2 - log J + lame / 2 (log J)^2."""
        a, b, c, d, around = gradient.T
        flat = a * d - b * c
        if not (flat > 0).all():
            raise ArithmeticError("a ring is inside out")
        log = np.log(flat * around)
        by_f = np.stack([d / flat, -c / flat, -b / flat, a / flat, 1 / around], axis=1)
        second = -by_f[:, :, None] * by_f[:, None]
        second[:, :4, 4] = second[:, 4, :4] = 0
        second[:, [0, 3, 1, 2], [3, 0, 2, 1]] += np.array([1, 1, -1, -1]) / flat[:, None]
        tension = self.lame * log - 1
        stiffness = np.eye(5) + self.lame * by_f[:, :, None] * by_f[:, None] + tension[:, None, None] * second
        return gradient + tension[:, None] * by_f, stiffness

    def contact(self, moves: Array, depth_mm: float, ball_mm: float) -> tuple[float, Array, list[tuple[Array, Array]]]:
        """Return the force of the ball, the penalty's gradient, and its second derivative by unknowns (K, 6)."""
        force, gradient, blocks = 0.0, np.zeros(len(moves)), []
        rest, at = self.rest[self.edges], (self.rest + moves.reshape(-1, 2))[self.edges]
        for place, weight in AT_EDGE:
            shape, slope = _quadratic(place)
            area = PENALTY * weight * (rest[:, :, 0] @ slope) * 2 * np.pi * (rest[:, :, 0] @ shape)
            r, z = np.einsum("kai,a->ik", at, shape)
            below = np.sqrt(np.maximum(ball_mm**2 - r**2, 1e-6))
            inside = np.flatnonzero((depth_mm - ball_mm + below > z) & (r < 0.9 * ball_mm))
            unknowns, push = _of_nodes(self.edges[inside]), area[inside] * (z - depth_mm + ball_mm - below)[inside]
            normal = np.zeros((len(inside), 6))
            normal[:, 0::2], normal[:, 1::2] = (r / below)[inside, None] * shape, shape
            bend = np.zeros((6, 6))
            bend[0::2, 0::2] = np.outer(shape, shape)
            curved = (push * ball_mm**2 / below[inside] ** 3)[:, None, None] * bend
            force -= float(push.sum())
            np.add.at(gradient, unknowns, push[:, None] * normal)
            blocks.append((unknowns, area[inside, None, None] * normal[:, :, None] * normal[:, None] + curved))
        return force, gradient, blocks


def force_of_ball(ball_mm: float, depth_mm: float, poisson_ratio: float, thickness_mm: float = 5.0) -> float:
    """Return the force of a ball without friction, shear moduli times mm2, on a gel 28 mm in diameter."""
    rings = Rings(14.0, thickness_mm, poisson_ratio)
    moves = np.zeros(2 * len(rings.rest))
    for depth in np.linspace(0, depth_mm, 1 + int(np.ceil(depth_mm / INCREMENT_MM)))[1:]:
        for _ in range(60):
            step = _newton_step(rings, moves, float(depth), ball_mm)
            longest = float(np.abs(step).max())
            moves[rings.free] += step * min(1.0, LONGEST_MM / longest)
            if longest < 1e-8:
                break
        else:
            raise ArithmeticError(f"at {depth:.3f} mm Newton's method does not end")
    return rings.contact(moves, depth_mm, ball_mm)[0]


def _newton_step(rings: Rings, moves: Array, depth_mm: float, ball_mm: float) -> Array:
    (gradient, blocks), (_, pushed, of_contact) = rings.elastic(moves), rings.contact(moves, depth_mm, ball_mm)
    all_blocks = [(rings.unknowns, blocks), *of_contact]
    rows = np.concatenate([np.repeat(one, one.shape[1], axis=1).ravel() for one, _ in all_blocks])
    columns = np.concatenate([np.tile(one, (1, one.shape[1])).ravel() for one, _ in all_blocks])
    values = np.concatenate([block.ravel() for _, block in all_blocks])
    matrix = sp.csc_matrix((values, (rows, columns)), shape=(len(moves), len(moves)))[rings.free][:, rings.free]
    return -np.asarray(scipy.sparse.linalg.spsolve(matrix, (gradient + pushed)[rings.free]))


def _graded(near_mm: float, end_mm: float) -> Array:
    """Return points from 0 to the end with their middles: FINE_MM apart up to `near_mm`, then further and further."""
    points, step = list(np.arange(0, near_mm + FINE_MM / 2, FINE_MM)), FINE_MM
    while points[-1] + 1.6 * step * GROWTH < end_mm:
        step *= GROWTH
        points.append(points[-1] + step)
    ends = np.array([*points, end_mm])
    return np.sort(np.concatenate([ends, (ends[1:] + ends[:-1]) / 2]))


def _quadratic(t: float) -> tuple[Array, Array]:
    """Return the three quadratic shape functions at t from -1 to 1, and their slopes."""
    return np.array([t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2]), np.array([t - 0.5, -2 * t, t + 0.5])


def _of_nodes(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the two unknowns of each node, side by side."""
    return np.stack([2 * nodes, 2 * nodes + 1], axis=2).reshape(len(nodes), 2 * nodes.shape[1])
