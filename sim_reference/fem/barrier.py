"""The barrier that keeps the gel out of the object (Li et al., Incremental Potential Contact, ACM TOG 39, 2020).

    B = kappa * sum over surface vertices of A b(g),   b(g) = -(g - d)^2 log(g / d) for 0 < g < d, else 0

g is the gap: how far a vertex lies above the object, along the object's z. A is the vertex's area at rest. b grows
without limit as the gap closes, and the barrier pushes only within the distance d, so the gel rests on the object with
a gap of some tenths of d. In units of the shear modulus times mm3, as the elastic energy.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_reference.fem.height_field import HeightField

Array = NDArray[np.float64]
STILL: Array = np.zeros((3, 3))
MOST_TURN = 0.25
"""of a step of the object, as a share of its size: what goes beyond is cut"""


@dataclass(frozen=True, eq=False)
class Barrier:
    """The barrier between vertices of the free surface and an object."""

    field: HeightField
    """of the object, in its own frame"""
    area: Array
    """(S,) mm2 of each vertex"""
    distance_mm: float
    """d"""
    stiffness: float
    """kappa, shear moduli per mm"""
    depth_mm: float
    """how far the object's point `pivot` is moved along z"""
    matrix: Array = dataclasses.field(default_factory=lambda: np.eye(3))
    """(3, 3) how the object is turned about `pivot`"""
    pivot: Array = dataclasses.field(default_factory=lambda: np.zeros(3))
    """(3,) a point of the object, in its own frame"""

    def local(self, at: Array) -> Array:
        """Return points `at` (S, 3) in the object's frame."""
        arm = (at - self.pivot - [0.0, 0.0, self.depth_mm]) @ np.linalg.inv(self.matrix).T
        return np.asarray(arm + self.pivot)

    def world(self, points: Array) -> Array:
        """Return where points (S, 3) of the object are."""
        return np.asarray((points - self.pivot) @ self.matrix.T + self.pivot + [0.0, 0.0, self.depth_mm])

    def gap(self, at: Array) -> Array:
        """Return the gap (S,) in mm of vertices `at` (S, 3)."""
        return self._gap(self.local(at))

    def value(self, at: Array) -> float:
        """Return B; infinite where a vertex is inside the object."""
        gap = self.gap(at)
        if not (gap > 0).all():
            return np.inf
        return float(self.stiffness * self.area @ potential(gap, self.distance_mm)[0])

    def pressure(self, at: Array) -> Array:
        """Return the pressure (S,) along z in shear moduli: -kappa b' dg/dz."""
        near = self._near(at)
        result = np.zeros(len(at))
        result[near] = -(self.gradient(at)[near, 2] / self.area[near])
        return result

    def gradient(self, at: Array) -> Array:
        """Return dB/dx (S, 3): kappa A b' grad g, with grad g = A^-T (-dh/dx, -dh/dy, 1)."""
        near = self._near(at)
        points = self.local(at[near])
        first = potential(self._gap(points), self.distance_mm)[1]
        result = np.zeros_like(at)
        result[near] = (self.stiffness * self.area[near] * first)[:, None] * self._gap_gradient(points)
        return result

    def hessian(self, at: Array, *, project: bool) -> Array:
        """Return d2B/dx2 (S, 3, 3): kappa A (b'' grad g grad g^T + b' hess g), semidefinite if `project`."""
        near = self._near(at)
        points = self.local(at[near])
        _, first, second = potential(self._gap(points), self.distance_mm)
        normal = self._gap_gradient(points)
        blocks = second[:, None, None] * normal[:, :, None] * normal[:, None, :]
        bend = -first[:, None, None] * self.field.heights(points[:, 0], points[:, 1]).curvature
        sideways = np.linalg.inv(self.matrix)[:2]
        blocks += sideways.T @ (semidefinite(bend) if project else bend) @ sideways
        result = np.zeros((len(at), 3, 3))
        result[near] = self.stiffness * self.area[near, None, None] * blocks
        return result

    def free_step(self, at: Array, step: Array, depth_change: float = 0.0, matrix_change: Array = STILL) -> float:
        """Return a share, at most 1, of a step of the gel (S, 3) and the object that lets no gap fall below a tenth.

        Each vertex goes on by what its gap and the steepest slope around it allow, again and again: the bound is on
        the whole way, not only on its end. In the frame of an object that turns, this way is

            X(s) = X(0) + s (I + s N)^-1 X'(0),   N = A^-1 dA,   X'(0) = A^-1 (dx - dc) - N (X(0) - P)

        and with |s N| <= e its speed differs from X'(0) by at most (1 / (1 - e)^2 - 1) |X'(0)|.
        """
        inverse = np.linalg.inv(self.matrix)
        turn = inverse @ matrix_change
        longest = MOST_TURN / max(float(np.linalg.norm(turn, 2)), MOST_TURN)
        turn *= longest
        start = self.local(at)
        straight = longest * (step - [0.0, 0.0, depth_change]) @ inverse.T - (start - self.pivot) @ turn.T
        return float(longest * self._free_way(start, straight, turn))

    def _free_way(self, start: Array, straight: Array, turn: Array) -> float:
        """Return the share of a way in the object's frame: from `start` on, X'(0) (S, 3) and N (3, 3)."""
        bent = (1 / (1 - np.linalg.norm(turn, 2)) ** 2 - 1) * np.linalg.norm(straight, axis=1)
        sideways = np.hypot(straight[:, 0], straight[:, 1]) + bent
        closing = np.maximum(-straight[:, 2], 0) + bent
        speed = closing + self.field.steepest(start[:, 0], start[:, 1], sideways) * sideways
        at_first = self._gap(start)
        moving = np.flatnonzero(0.9 * at_first < speed)
        gap, gone = at_first[moving], np.zeros(len(moving))
        way = np.ones(len(start))
        for _ in range(100):
            if not len(moving):
                break
            gone = np.minimum(gone + 0.9 * gap / speed[moving], 1)
            gap = self._gap(start[moving] + _gone(straight[moving], turn, gone))
            go_on = gap > 0.1 * at_first[moving]
            way[moving[go_on]] = gone[go_on]
            way[moving[~go_on]] = np.minimum(way[moving[~go_on]], gone[~go_on])
            going = go_on & (gone < 1)
            moving, gap, gone = moving[going], gap[going], gone[going]
        return float(min(way.min(), gone.min(initial=1.0)))

    def _gap(self, points: Array) -> Array:
        return points[:, 2] - self.field(points[:, 0], points[:, 1])

    def _near(self, at: Array) -> NDArray[np.int64]:
        return np.flatnonzero(self.gap(at) < self.distance_mm)

    def _gap_gradient(self, points: Array) -> Array:
        slope = self.field.heights(points[:, 0], points[:, 1]).slope
        return np.asarray(np.concatenate([-slope, np.ones((len(points), 1))], axis=1) @ np.linalg.inv(self.matrix))


def _gone(straight: Array, turn: Array, share: Array) -> Array:
    """Return s (I + s N)^-1 X'(0) (S, 3) for a share (S,) of the way."""
    way = share[:, None] * straight
    if not turn.any():
        return way
    return np.asarray(np.linalg.solve(np.eye(3) + share[:, None, None] * turn, way[:, :, None])[:, :, 0])


def potential(gap: Array, distance: float) -> tuple[Array, Array, Array]:
    """Return b, b' and b'' at `gap` > 0."""
    g = np.minimum(gap, distance)
    below, log = g - distance, np.log(g / distance)
    return -(below**2) * log, -2 * below * log - below**2 / g, -2 * log - 4 * below / g + (below / g) ** 2


def semidefinite(blocks: Array) -> Array:
    """Return symmetric blocks (S, k, k) with their negative eigenvalues set to 0."""
    values, axes = np.linalg.eigh(blocks)
    return np.asarray(np.einsum("sik,sk,sjk->sij", axes, np.maximum(values, 0), axes))
