"""How an object leans under a load as the linear layer holds it: where the press by finite elements begins."""

from dataclasses import dataclass, field

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from sim_reference import gel
from sim_reference.deformation import Deformation, NotConverged, grid
from sim_reference.fem.affine_body import Load, rotation, tilt_rad
from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
MOST_TILT_RAD = float(np.deg2rad(15))
"""an object that is free tilts no further: it falls over"""


@dataclass(frozen=True, eq=False)
class Lean:
    """How an object stands at a depth of its point `pivot`."""

    depth_mm: float
    pivot: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) mm"""
    slopes: Array = field(default_factory=lambda: np.zeros(2))
    """(2,) dz/dx, dz/dy of a plane of the object that is level when it stands upright"""

    @property
    def matrix(self) -> Array:
        """(3, 3) see `affine_body`."""
        return rotation(self.slopes)

    def press(
        self, object_height_mm: Array, spacing_mm: float, depth_mm: float, geometry: SensorGeometry
    ) -> Deformation:
        """Return what the layer answers to the leaning object at another depth."""
        at = grid(len(object_height_mm), spacing_mm)
        x, y = at[None, :] - self.pivot[0], at[:, None] - self.pivot[1]
        return gel.press(object_height_mm + self.slopes[0] * x + self.slopes[1] * y, spacing_mm, depth_mm, geometry)


def lean_under(
    load: Load, object_height_mm: Array, spacing_mm: float, depth_mm: float, geometry: SensorGeometry
) -> Lean:
    """Return about how the object stands under the load, looked for from upright at `depth_mm`.

    The layer's pressure is to have the load as its sum and the load's point as its centre. Raises NotConverged for an
    object that falls over.
    """
    pivot = np.array([*load.at_mm, 0.0])
    at, steepest = grid(len(object_height_mm), spacing_mm), float(np.tan(MOST_TILT_RAD))

    def lean(unknown: Array) -> Lean:
        depth = float(np.clip(unknown[0], 0.05 * depth_mm, geometry.deepest_press_mm))
        return Lean(depth, pivot, np.clip(unknown[1:], -steepest, steepest))

    def missing(unknown: Array) -> Array:
        """Force and moments that are missing, over the load."""
        tried = lean(unknown)
        pressed = tried.press(object_height_mm, spacing_mm, tried.depth_mm, geometry)
        held = pressed.pressure * spacing_mm**2 / load.force
        across = (held * (at[None, :] - pivot[0])).sum(), (held * (at[:, None] - pivot[1])).sum()
        return np.array([held.sum() - 1, *across])

    try:
        found = scipy.optimize.root(missing, [depth_mm, 0.0, 0.0], options={"xtol": 1e-2, "eps": 1e-6, "maxfev": 30})
    except NotConverged:
        return Lean(depth_mm, pivot)
    check_tilt(tilt_rad(lean(found.x).matrix))
    return lean(found.x)


def check_tilt(angle_rad: float) -> None:
    """Refuse an object that tilts as far as one that falls over."""
    if angle_rad > 0.999 * MOST_TILT_RAD:
        raise NotConverged(
            f"the object falls over: it tilts by {np.rad2deg(MOST_TILT_RAD):.0f} degrees or more. Put the load nearer "
            "to the middle of the contact"
        )
