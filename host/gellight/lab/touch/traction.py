"""Traction along the gel with Coulomb's limit: where a pressed gel sticks to what moves, and where it slips."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from sim_reference import tangential


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
    """The tangential layer of one gel (`sim_reference.tangential`)."""

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
        pressure = np.asarray(pressure_mpa, np.float64) / self.shear_modulus_mpa
        return self._sheared(tangential.at_rest(pressure, self._layer))

    def drag(
        self, pressure_mpa: NDArray[np.float32], motion: tuple[float, float, float],
        friction: float, before: Sheared | None,
    ) -> Sheared:  # fmt: skip
        """Return the gel after a motion (x mm, y mm, turn rad about the gel's centre); raises as `TouchSensor.drag`."""
        if not friction >= 0 or not np.isfinite([friction, *motion]).all():
            raise InputError(f"a motion of {motion} with friction {friction:g}: give finite mm and rad, and 0 or more")
        pressure = np.asarray(pressure_mpa, np.float64) / self.shear_modulus_mpa
        begun = tangential.at_rest(pressure, self._layer) if before is None else before.state
        moved = tangential.rigid_motion(self.at_mm[None, :], self.at_mm[:, None], motion)
        return self._sheared(tangential.drag(begun, pressure, moved, friction, self._layer))

    def _sheared(self, state: tangential.Dragged) -> Sheared:
        traction = state.traction * self.shear_modulus_mpa
        return Sheared(traction, state.displacement_mm, state.sticks, self.at_mm, state)
