"""The elastic layer of `sim_reference.gel` in single precision, for any gap between gel and objects."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_reference import gel
from sim_reference.deformation import NO_OBJECT, grid
from sim_reference.geometry import SensorGeometry

Floats = NDArray[Any]
"""of float32 in and out, of float64 where NumPy computes in between"""
TOLERANCE = 1e-4
"""the pressure changes by less than this share in the last iteration"""
MARGIN = 2
"""gel thicknesses between a contact and the border of the periodic grid: a square felt 8 % more at 1.4 of them"""


class Layer:
    """The gel on a square grid around its centre."""

    def __init__(self, geometry: SensorGeometry, size: int, extent_mm: float, shear_modulus_mpa: float) -> None:
        """Prepare for `size` x `size` points over `extent_mm` mm."""
        self.spacing_mm = extent_mm / size
        self.at_mm = grid(size, self.spacing_mm)
        """(n,) x of the columns and y of the rows, from the centre of the gel"""
        self._beside = np.hypot(self.at_mm[None, :], self.at_mm[:, None]) > geometry.gel_diameter_mm / 2
        near = np.abs(self.at_mm) > extent_mm / 2 - MARGIN * geometry.gel_thickness_mm + 1e-9
        self._near_border, self._extent_mm = near[None, :] | near[:, None], extent_mm
        self._thickness_mm, self._shear_modulus_mpa = geometry.gel_thickness_mm, shear_modulus_mpa
        self.deepest_mm = geometry.deepest_press_mm
        """deeper presses are refused"""
        response = gel.compliance(size, self.spacing_mm, geometry.gel_thickness_mm, geometry.poisson_ratio)
        self._response = response.astype(np.float32)
        self._coated = (response * gel.coating(size, self.spacing_mm, geometry.coating_smoothing_mm)).astype(np.float32)

    @property
    def size(self) -> int:
        """Points along a side."""
        return len(self.at_mm)

    def pressure_mpa(self, gap_mm: Floats) -> Floats:
        """Return the pressure (n, n), MPa, under objects at the distance `gap_mm` (n, n) from the gel at rest.

        A gap is negative where an object would penetrate, `NOTHING` where none is. Raises ValueError for another shape,
        for what is not finite, for an object deeper than 60 % of the gel, and for a contact nearer than `MARGIN` gel
        thicknesses to the border of the grid; NotConverged.
        """
        found: Floats = gel.contact_pressure(self.check(gap_mm), self._response, self._thickness_mm, TOLERANCE)
        if found[self._near_border].any():
            margin_mm = MARGIN * self._thickness_mm
            raise ValueError(
                f"a contact reaches beyond {self._extent_mm / 2 - margin_mm:g} mm from the middle of a grid of "
                f"{self._extent_mm:g} mm, whose border is to stay {margin_mm:g} mm away: give a larger extent_mm"
            )
        return found * np.float32(self._shear_modulus_mpa)

    def depth_mm(self, pressure_mpa: Floats) -> Floats:
        """Return the depth (n, n), mm, of the coated gel under a pressure (n, n), MPa."""
        depth: Floats = gel.deflection(pressure_mpa, self._coated) / np.float32(self._shear_modulus_mpa)
        return depth

    def force_n(self, pressure_mpa: Floats) -> float:
        """Return the normal force of a pressure (n, n), N."""
        return float(pressure_mpa.sum(dtype=np.float64)) * self.spacing_mm**2

    def check(self, gap_mm: Floats) -> Floats:
        """Return a gap as float32, `NOTHING` beside the gel; raises as `pressure_mpa`."""
        gap = self.before(gap_mm)
        if gap.min() < -self.deepest_mm:
            raise ValueError(
                f"an object lies {-gap.min():.2f} mm deep in a gel that is simulated to {self.deepest_mm:g} mm: "
                "make the step of the simulation shorter, or press less"
            )
        return gap

    def before(self, gap_mm: Floats) -> Floats:
        """Return a gap as float32, `NOTHING` beside the gel, however deep; ValueError for a shape or number."""
        gap = np.asarray(gap_mm, np.float32)
        if gap.shape != self._beside.shape or not np.isfinite(gap).all():
            raise ValueError(
                f"a gap of shape {gap.shape}: give {self._beside.shape} finite mm, NOTHING where nothing is"
            )
        return np.where(self._beside, np.float32(NOTHING), gap)


NOTHING = -NO_OBJECT
"""mm: the gap where no object is"""
