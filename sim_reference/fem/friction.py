"""Friction, lagged as in Incremental Potential Contact (Li et al., ACM TOG 39, 2020, section 5).

    D = coefficient * sum over vertices of N f(|u|),   f'(y) = 2 y / e - y^2 / e^2 below e, 1 above

N is the normal force and u the part of a vertex's movement along the object's surface since the last step of the press,
both with the contact as it was when it was last evaluated. So D has a gradient and a Hessian, and is evaluated again
until it changes nothing. Below the movement e the vertex sticks, up to e. In shear moduli times mm3.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_reference.fem.barrier import Barrier, semidefinite

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction at the vertices of the free surface."""

    coefficient: float
    force: Array
    """(S,) N, shear moduli times mm2"""
    tangents: Array
    """(S, 2, 3) two unit vectors along the object's surface"""
    start: Array
    """(S, 3) where the gel's vertices would be had they stuck to the object"""
    stick_mm: float
    """e"""

    def value(self, at: Array) -> float:
        """Return D with the vertices `at` (S, 3)."""
        slip, e = self._slip(at), self.stick_mm
        length = np.linalg.norm(slip, axis=1)
        # f(e) = e by the choice of the constant, so that f is y above e.
        work = np.where(length < e, length**2 / e - length**3 / (3 * e**2) + e / 3, length)
        return float(self.coefficient * self.force @ work)

    def gradient(self, at: Array) -> Array:
        """Return dD/dx (S, 3): coefficient N f'(|u|)/|u| T^T u."""
        slip = self._slip(at)
        pull = self.coefficient * self.force * self._f1_over_y(np.linalg.norm(slip, axis=1))
        return np.asarray(np.einsum("s,sti,st->si", pull, self.tangents, slip))

    def hessian(self, at: Array, *, project: bool) -> Array:
        """Return d2D/dx2 (S, 3, 3): coefficient N T^T (f'/y I + (f'/y)'/y u u^T) T, semidefinite if `project`."""
        slip, e = self._slip(at), self.stick_mm
        length = np.maximum(np.linalg.norm(slip, axis=1), 1e-12 * e)
        change = np.where(length < e, -1 / (e**2 * length), -1 / length**3)
        inner = self._f1_over_y(length)[:, None, None] * np.eye(2)
        inner = inner + change[:, None, None] * slip[:, :, None] * slip[:, None, :]
        inner = semidefinite(inner) if project else inner
        scale = self.coefficient * self.force
        return np.asarray(np.einsum("s,sti,stu,suj->sij", scale, self.tangents, inner, self.tangents))

    def _slip(self, at: Array) -> Array:
        return np.asarray(np.einsum("sti,si->st", self.tangents, at - self.start))

    def _f1_over_y(self, length: Array) -> Array:
        """f'(y) / y."""
        e = self.stick_mm
        return np.where(length < e, 2 / e - length / e**2, 1 / np.maximum(length, e))


def friction_of(barrier: Barrier, at: Array, start: Array, coefficient: float, stick_mm: float) -> Friction:
    """Return the friction of the contact as it is `at` (S, 3), for movements from `start`."""
    normal_force = np.linalg.norm(barrier.gradient(at), axis=1)
    normal = barrier.gap_gradient(at)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along_x = np.stack([normal[:, 2], np.zeros(len(at)), -normal[:, 0]], axis=1)
    along_x /= np.linalg.norm(along_x, axis=1, keepdims=True)
    tangents = np.stack([along_x, np.cross(normal, along_x)], axis=1)
    return Friction(coefficient, normal_force, tangents, start, stick_mm)
