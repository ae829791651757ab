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
LEAST_UPRIGHT = 0.1
"""of dg/dz: under walls of a turned object that hang over, a lift does not help"""


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
    """how far the object's origin is moved along z"""
    matrix: Array = dataclasses.field(default_factory=lambda: np.eye(3))
    """(3, 3) how the object is turned about its origin"""
    shift_mm: Array = dataclasses.field(default_factory=lambda: np.zeros(2))
    """(2,) how far its origin is moved along x and y"""

    @property
    def moved_mm(self) -> Array:
        """(3,) how far its origin is moved."""
        return np.append(self.shift_mm, self.depth_mm)

    def local(self, at: Array) -> Array:
        """Return points `at` (S, 3) in the object's frame."""
        return np.asarray((at - self.moved_mm) @ np.linalg.inv(self.matrix).T)

    def world(self, points: Array) -> Array:
        """Return where points (S, 3) of the object are."""
        return np.asarray(points @ self.matrix.T + self.moved_mm)

    def gap(self, at: Array) -> Array:
        """Return the gap (S,) in mm of vertices `at` (S, 3)."""
        points = self.local(at)
        return points[:, 2] - self.field(points[:, 0], points[:, 1])

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
        first = potential(self.gap(at[near]), self.distance_mm)[1]
        result = np.zeros_like(at)
        result[near] = (self.stiffness * self.area[near] * first)[:, None] * self.gap_gradient(at[near])
        return result

    def hessian(self, at: Array, *, project: bool) -> Array:
        """Return d2B/dx2 (S, 3, 3): kappa A (b'' grad g grad g^T + b' hess g), semidefinite if `project`."""
        near = self._near(at)
        points = self.local(at[near])
        _, first, second = potential(self.gap(at[near]), self.distance_mm)
        normal = self.gap_gradient(at[near])
        blocks = second[:, None, None] * normal[:, :, None] * normal[:, None, :]
        bend = -first[:, None, None] * self.field.heights(points[:, 0], points[:, 1]).curvature
        sideways = np.linalg.inv(self.matrix)[:2]
        blocks += sideways.T @ (semidefinite(bend) if project else bend) @ sideways
        result = np.zeros((len(at), 3, 3))
        result[near] = self.stiffness * self.area[near, None, None] * blocks
        return result

    def lift(self, at: Array, step: Array) -> Array:
        """Return how far (S,) mm vertices `at` (S, 3) are lifted along z after `step`, so that none is in the object.

        Newton's step changes a gap g by c to first order. Within the distance, g becomes g + c, or g^2 / (g - c) where
        it closes: there the pressure grows like 1/g, and does so by what the step expects. Other vertices keep half the
        distance. Small steps are changed by terms of second order only.
        """
        after = at + step
        gap, reached = self.gap(at), self.gap(after)
        change = (self.gap_gradient(at) * step).sum(axis=1)
        wanted = np.maximum(change, 0) + gap**2 / (gap - np.minimum(change, 0))
        touching = np.maximum(gap, wanted) < self.distance_mm
        least = np.minimum(gap, 0.5 * self.distance_mm)
        widened = np.where(touching, wanted - reached, np.maximum(least - reached, 0))
        return widened / np.maximum(self.gap_gradient(after)[:, 2], LEAST_UPRIGHT)

    def gap_gradient(self, at: Array) -> Array:
        """Return grad g (S, 3) at vertices `at`."""
        points = self.local(at)
        slope = self.field.heights(points[:, 0], points[:, 1]).slope
        return np.asarray(np.concatenate([-slope, np.ones((len(at), 1))], axis=1) @ np.linalg.inv(self.matrix))

    def _near(self, at: Array) -> NDArray[np.int64]:
        return np.flatnonzero(self.gap(at) < self.distance_mm)


def potential(gap: Array, distance: float) -> tuple[Array, Array, Array]:
    """Return b, b' and b'' at `gap` > 0."""
    g = np.minimum(gap, distance)
    below, log = g - distance, np.log(g / distance)
    return -(below**2) * log, -2 * below * log - below**2 / g, -2 * log - 4 * below / g + (below / g) ** 2


def semidefinite(blocks: Array) -> Array:
    """Return symmetric blocks (S, k, k) with their negative eigenvalues set to 0."""
    values, axes = np.linalg.eigh(blocks)
    return np.asarray(np.einsum("sik,sk,sjk->sij", axes, np.maximum(values, 0), axes))
