"""The springs by which gels hold bodies, and the forces in them that agree with what a gel can do.

A gel pushes only, tilts a body by no more than its pressure can move, and holds it by no more than friction. What is
cut away would have turned and stopped the body too, so the other forces are solved for again until all agree (projected
Gauss-Seidel: Jourdan, Alart and Jean, Comput. Methods Appl. Mech. Eng. 155, 1998). Cut once and left, they give a light
body energy.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SLIDING = [0, 1, 5]
"""of the six motions: along x, along y, and the spin"""
APART = ([2], [3], [4], SLIDING[:2], [5])
"""motions whose forces are cut together: out of the gel, the tilts, along it, the spin"""
MOST_SWEEPS, AGREED = 200, 1e-9
"""until no force changes by more, N and N m"""
AT_LIMIT = 1 - 1e-6
"""of what friction holds, from where a body slips"""


@dataclass(eq=False)
class Spring:
    """One body in one gel, during a step."""

    gel: str
    body: int
    holder: int
    """the body of the gel"""
    axes: Floats
    """(3, 3) of the gel, as columns, in the world"""
    point: Floats
    """(3,) m, where the force acts, in the world"""
    jacobian: Floats
    """(6, nv) motion of body against gel: along the axes, then about them"""
    stiffness: Floats
    """(6,) N/m and N m/rad"""
    at_rest: Floats
    """(6,) force and torque if nothing moved on, as linear in the motion"""
    friction: float
    """Coulomb's coefficient"""
    reach: Floats
    """(2,) m: how far from its centre the pressure can move, in y and x"""
    lever: float
    """m: the mean distance of the pressure from its centre"""

    def limits(self, force: Floats) -> tuple[float, float]:
        """Return what friction holds, N along the gel and N m of spin."""
        limit = self.friction * float(force[2])
        return limit, limit * self.lever

    def cut(self, force: Floats) -> None:
        """Cut a force (6,) in place to what a gel can do: push, tilt within the contact, hold within friction."""
        force[2] = max(force[2], 0.0)
        limit, most = self.limits(force)
        _shorten(force[:2], limit)
        for turn, longest in zip((3, 4, 5), (*(force[2] * self.reach), most), strict=True):
            force[turn] = min(max(force[turn], -longest), longest)

    def sticks(self, force: Floats) -> bool:
        """Tell whether a force (6,) is less than what friction holds."""
        limit, most = self.limits(force)
        return bool(np.linalg.norm(force[:2]) < AT_LIMIT * limit and abs(force[5]) < AT_LIMIT * most)

    def slip(self, bristle: Floats, force: Floats) -> None:
        """Shorten a bristle (3,) in place to what friction holds under a force (6,)."""
        limit, most = self.limits(force)
        _shorten(bristle[:2], limit / max(self.stiffness[0], 1e-9))
        bristle[2] = np.clip(bristle[2], *(np.array([-1, 1]) * most / max(self.stiffness[5], 1e-9)))


def solve(
    springs: list[Spring], jacobian: Floats, moved: Floats, free: Floats, step_s: float, loss_time_s: float
) -> Floats:
    """Return the forces (n, 6) at the end of a step.

    jacobian: (6 n, nv) of all springs; moved: (6 n, nv) accelerations by a unit of each force; free: (nv,) velocities
    without these forces.
    """
    damping = (step_s + loss_time_s) * np.concatenate([spring.stiffness for spring in springs])
    at_rest = np.concatenate([spring.at_rest for spring in springs])
    system = np.eye(len(damping)) + step_s * damping[:, None] * (jacobian @ moved.T)
    wanted = at_rest - damping * (jacobian @ free)
    forces = np.asarray(np.linalg.solve(system, wanted), np.float64).reshape(-1, 6)
    uncut = forces.copy()
    for spring, force in zip(springs, forces, strict=True):
        spring.cut(force)
    if not np.array_equal(forces, uncut):
        _agree(springs, forces, system, wanted)
    return forces


def _agree(springs: list[Spring], forces: Floats, system: Floats, wanted: Floats) -> None:
    """Change forces (n, 6) in place until system @ forces = wanted but where they are cut."""
    flat = forces.reshape(-1)
    parts = [
        (spring, force, row, 1 / np.linalg.norm(system[np.ix_(row, row)], 2))
        for number, (spring, force) in enumerate(zip(springs, forces, strict=True))
        for row in (6 * number + np.array(part) for part in APART)
    ]
    for _ in range(MOST_SWEEPS):
        before = flat.copy()
        for spring, force, row, step in parts:
            flat[row] += step * (wanted[row] - system[row] @ flat)
            spring.cut(force)
        if np.abs(flat - before).max() <= AGREED:
            return


def _shorten(vector: Floats, longest: float) -> None:
    """Shorten a vector (2,) in place to a length at most."""
    length = np.hypot(*vector)
    if length > longest:
        vector *= longest / length
