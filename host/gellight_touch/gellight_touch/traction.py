"""Traction along the gel with Coulomb's limit: where a pressed gel sticks to what moves, and where it slips."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from gellight.base.errors import InputError
from sim_reference.fem import tangential

PULLED_WITHIN = 1e-3
"""of a load that is to be carried"""
LITTLE_MM = 1e-3
FAR = 5.0
"""thicknesses of the gel: what has gone so far slips everywhere"""


@dataclass(frozen=True, eq=False)
class Sheared:
    """The gel along its surface, on the layer's grid, x and y last; `tangential_mm` moves what lies on the surface."""

    traction_mpa: NDArray[np.float64]
    """(n, n, 2) on the gel; no longer than friction times pressure"""
    tangential_mm: NDArray[np.float64]
    """(n, n, 2) by which the surface moved along the gel, with what the pressure moves"""
    sticks: NDArray[np.bool_]
    """(n, n) where the gel is touched and did not slip in this step"""
    at_mm: NDArray[np.float64]
    """(n,) coordinates of rows and columns"""
    state: tangential.Dragged
    """what the next step begins with"""

    @property
    def force_n(self) -> tuple[float, float]:
        """The force along x and y on the gel, N."""
        x, y = self.traction_mpa.sum(axis=(0, 1)) * self._cell_mm2
        return float(x), float(y)

    @property
    def torque_nmm(self) -> float:
        """The torque on the gel about its centre, from x to y, N mm."""
        turning = self.at_mm[None, :] * self.traction_mpa[..., 1] - self.at_mm[:, None] * self.traction_mpa[..., 0]
        return float(turning.sum() * self._cell_mm2)

    @property
    def _cell_mm2(self) -> float:
        return float(self.at_mm[1] - self.at_mm[0]) ** 2


@dataclass(frozen=True, eq=False)
class Traction:
    """The tangential layer of one gel (`sim_reference.fem.tangential`)."""

    at_mm: NDArray[np.float64]
    thickness_mm: float
    poisson_ratio: float
    shear_modulus_mpa: float

    @cached_property
    def _layer(self) -> tangential.Layer:
        size = len(self.at_mm)
        spacing_mm = float(self.at_mm[1] - self.at_mm[0])
        return tangential.Layer((size, size), spacing_mm, self.thickness_mm, self.poisson_ratio)

    def pressed(self, pressure_mpa: NDArray[np.float32]) -> Sheared:
        """Return the gel under a pressure alone (n, n), MPa."""
        pressure = self._over_modulus(pressure_mpa)
        return self._sheared(tangential.at_rest(pressure, self._layer))

    def drag(
        self, pressure_mpa: NDArray[np.float32], motion: tuple[float, float, float],
        friction: float, before: Sheared | None,
    ) -> Sheared:  # fmt: skip
        """Return the gel after a motion (x mm, y mm, turn rad about the gel's centre); raises as `TouchSensor.drag`."""
        check_friction(friction)
        if np.shape(motion) != (3,) or not np.isfinite(motion).all():
            raise InputError(f"a motion of {motion}: give x and y in mm and the turn in rad, finite")
        pressure = self._over_modulus(pressure_mpa)
        begun = tangential.at_rest(pressure, self._layer) if before is None else before.state
        moved = tangential.rigid_motion(self.at_mm[None, :], self.at_mm[:, None], motion)
        return self._sheared(tangential.drag(begun, pressure, moved, friction, self._layer))

    def go_on(
        self, pressure_mpa: NDArray[np.float32], moved_mm: NDArray[np.float64], friction: float, before: Sheared | None
    ) -> Sheared:
        """Return the gel after what lies on each point has gone by `moved_mm` (n, n, 2) since `before`.

        Raises as `TouchSensor.go_on`.
        """
        check_friction(friction)
        if np.shape(moved_mm) != (*pressure_mpa.shape, 2) or not np.isfinite(moved_mm).all():
            raise InputError(f"motions of shape {np.shape(moved_mm)}: give {(*pressure_mpa.shape, 2)} finite mm")
        pressure = self._over_modulus(pressure_mpa)
        begun = tangential.at_rest(pressure, self._layer) if before is None else before.state
        begun = replace(begun, offset_mm=begun.displacement_mm)
        return self._sheared(tangential.drag(begun, pressure, moved_mm, friction, self._layer))

    def pull(
        self, pressure_mpa: NDArray[np.float32], centre_mm: tuple[float, float], load: tuple[float, float, float],
        friction: float,
    ) -> Sheared:  # fmt: skip
        """Return the gel after a straight motion to where it carries a load; raises as `TouchSensor.pull`.

        load: N, N, N mm about the gel's centre; centre_mm: x, y of the pressure. The gel's energy less the work of the
        load is convex in the motion, and its gradient is what the gel carries less the load. Motions are in N, by the
        stiffness of a small one.
        """
        check_friction(friction)
        if np.shape(load) != (3,) or not np.isfinite(load).all():
            raise InputError(f"a load of {load}: give x and y in N and the torque in N mm, finite")
        rest = self.pressed(pressure_mpa)
        if friction == 0 or not any(load) or not (pressure_mpa > 0).any():
            return rest
        (x, y), cell_mm2 = centre_mm, float(self.at_mm[1] - self.at_mm[0]) ** 2
        rim_mm = float(np.sqrt(np.count_nonzero(pressure_mpa) * cell_mm2 / np.pi))
        ways, sheared = self._ways(centre_mm, rim_mm), rest
        asked = np.array([load[0], load[1], (load[2] - x * load[1] + y * load[0]) / rim_mm])
        wanted = _held(asked, friction * cell_mm2 * pressure_mpa, ways)

        def moved(motion_mm: NDArray[np.float64], guess: Sheared) -> Sheared:
            begun = replace(rest.state, traction=guess.state.traction)
            return self.go_on(pressure_mpa, np.tensordot(motion_mm, ways, 1), friction, replace(rest, state=begun))

        def missing(motion_n: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
            nonlocal sheared
            sheared = moved(motion_n / stiffness, sheared)
            bent = np.vdot(sheared.traction_mpa, sheared.tangential_mm - rest.tangential_mm) * cell_mm2
            missed = np.tensordot(ways, sheared.traction_mpa, 3) * cell_mm2 - wanted
            return float(motion_n @ missed - stiffness * bent / 2), missed

        stiffness = moved(np.array([LITTLE_MM, 0.0, 0.0]), rest).force_n[0] / LITTLE_MM
        far_n = FAR * self.thickness_mm * stiffness
        enough = {"gtol": PULLED_WITHIN * float(np.abs(wanted).max()), "ftol": 0, "maxiter": 30}
        found = minimize(missing, wanted, jac=True, method="L-BFGS-B", bounds=[(-far_n, far_n)] * 3, options=enough)
        return moved(found.x / stiffness, sheared)

    def _ways(self, centre_mm: tuple[float, float], rim_mm: float) -> NDArray[np.float64]:
        """Return motions (3, n, n, 2), mm: along x, along y, and a turn about the centre that moves the rim by 1."""
        ways = np.zeros((3, len(self.at_mm), len(self.at_mm), 2))
        ways[0, ..., 0] = ways[1, ..., 1] = 1.0
        ways[2, ..., 0] = -(self.at_mm[:, None] - centre_mm[1]) / rim_mm
        ways[2, ..., 1] = (self.at_mm[None, :] - centre_mm[0]) / rim_mm
        return ways

    def _over_modulus(self, pressure_mpa: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return a pressure (n, n) in units of the shear modulus; InputError for one that another sensor felt."""
        check_grid(len(pressure_mpa), len(self.at_mm))
        return np.asarray(pressure_mpa, np.float64) / self.shear_modulus_mpa

    def _sheared(self, state: tangential.Dragged) -> Sheared:
        traction = state.traction * self.shear_modulus_mpa
        return Sheared(traction, state.displacement_mm, state.sticks, self.at_mm, state)


def _held(load_n: NDArray[np.float64], grip_n: NDArray[np.floating], ways: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shorten the force and the turn of a load (3,) to what cells hold by `grip_n` (n, n) each.

    Under more, what slips would go on without an end, and not along the load.
    """
    most_n, turned_n = (float(np.vdot(grip_n, np.linalg.norm(way, axis=-1))) for way in ways[1:])
    share = min(1.0, most_n / max(float(np.hypot(*load_n[:2])), 1e-12))
    return np.array([*share * load_n[:2], min(max(load_n[2], -turned_n), turned_n)])


def check_friction(coefficient: float) -> None:
    """Raise InputError for a coefficient that is negative or not finite."""
    if not 0 <= coefficient < np.inf:
        raise InputError(f"friction {coefficient:g}: give Coulomb's coefficient, 0 or more")


def check_grid(felt: int, own: int) -> None:
    """Raise InputError where a gel was felt on another number of points than this sensor has."""
    if felt != own:
        raise InputError(f"felt on {felt} points a side by another sensor: this one has {own}")
