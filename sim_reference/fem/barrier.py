"""The barrier that keeps the gel out of the object (Li et al., Incremental Potential Contact, ACM TOG 39, 2020).

    B = kappa * sum over surface vertices of A b(g),   b(g) = -(g - d)^2 log(g / d) for 0 < g < d, else 0

g is the gap: how far a vertex lies above the object, along z. A is the vertex's area at rest. b grows without limit as
the gap closes, and the barrier pushes only within the distance d, so the gel rests on the object with a gap of some
tenths of d. In units of the shear modulus times mm3, as the elastic energy.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_reference.fem.height_field import HeightField

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Barrier:
    """The barrier between vertices of the free surface and an object."""

    field: HeightField
    area: Array
    """(S,) mm2 of each vertex"""
    distance_mm: float
    """d"""
    stiffness: float
    """kappa, shear moduli per mm"""
    depth_mm: float
    """how far the object is moved along z"""

    def gap(self, at: Array) -> Array:
        """Return the gap (S,) in mm of vertices `at` (S, 3)."""
        return at[:, 2] - self.depth_mm - self.field(at[:, 0], at[:, 1])

    def value(self, at: Array) -> float:
        """Return B; infinite where a vertex is inside the object."""
        gap = self.gap(at)
        if not (gap > 0).all():
            return np.inf
        return float(self.stiffness * self.area @ potential(gap, self.distance_mm)[0])

    def pressure(self, at: Array) -> Array:
        """Return the pressure (S,) along z in shear moduli: -kappa b'."""
        return -self.stiffness * potential(self.gap(at), self.distance_mm)[1]

    def gradient(self, at: Array) -> Array:
        """Return dB/dx (S, 3): kappa A b' grad g, with grad g = (-dh/dx, -dh/dy, 1)."""
        near = self._near(at)
        result = np.zeros_like(at)
        result[near] = -(self.area[near] * self.pressure(at[near]))[:, None] * self._gap_gradient(at[near])
        return result

    def hessian(self, at: Array, *, project: bool) -> Array:
        """Return d2B/dx2 (S, 3, 3): kappa A (b'' grad g grad g^T + b' hess g), semidefinite if `project`."""
        near = self._near(at)
        points = at[near]
        _, first, second = potential(self.gap(points), self.distance_mm)
        normal = self._gap_gradient(points)
        blocks = second[:, None, None] * normal[:, :, None] * normal[:, None, :]
        bend = -first[:, None, None] * self.field.heights(points[:, 0], points[:, 1]).curvature
        blocks[:, :2, :2] += semidefinite(bend) if project else bend
        result = np.zeros((len(at), 3, 3))
        result[near] = self.stiffness * self.area[near, None, None] * blocks
        return result

    def lift(self, at: Array, step: Array) -> Array:
        """Return how far (S,) mm vertices `at` (S, 3) are lifted along z after `step`, so that none is in the object.

        Newton's step changes a gap g by c to first order. Within the distance, g becomes g + c, or g^2 / (g - c) where
        it closes: there the pressure grows like 1/g, and does so by what the step expects. Other vertices keep half
        the distance. Small steps are changed by terms of second order only.
        """
        gap, reached = self.gap(at), self.gap(at + step)
        change = (self._gap_gradient(at) * step).sum(axis=1)
        wanted = np.maximum(change, 0) + gap**2 / (gap - np.minimum(change, 0))
        touching = np.maximum(gap, wanted) < self.distance_mm
        least = np.minimum(gap, 0.5 * self.distance_mm)
        return np.where(touching, wanted - reached, np.maximum(least - reached, 0))

    def _near(self, at: Array) -> NDArray[np.int64]:
        return np.flatnonzero(self.gap(at) < self.distance_mm)

    def _gap_gradient(self, at: Array) -> Array:
        slope = self.field.heights(at[:, 0], at[:, 1]).slope
        return np.concatenate([-slope, np.ones((len(at), 1))], axis=1)


def potential(gap: Array, distance: float) -> tuple[Array, Array, Array]:
    """Return b, b' and b'' at `gap` > 0."""
    g = np.minimum(gap, distance)
    below, log = g - distance, np.log(g / distance)
    return -(below**2) * log, -2 * below * log - below**2 / g, -2 * log - 4 * below / g + (below / g) ** 2


def semidefinite(blocks: Array) -> Array:
    """Return symmetric blocks (S, k, k) with their negative eigenvalues set to 0."""
    values, axes = np.linalg.eigh(blocks)
    return np.asarray(np.einsum("sik,sk,sjk->sij", axes, np.maximum(values, 0), axes))
