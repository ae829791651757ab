"""What a model of the gel takes and gives (section 2.2.1): an object's height map in, the gel's surface out.

Any `GelModel` can be passed as `surface.press_object(..., model=...)`: `gel.press`, an elastic layer of small strain,
is the default; `fem.gel.FemGel` is the finite-element gel.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import spline_filter

from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
NO_OBJECT = -1e3
"""height in mm of "nothing there": far below anything that could touch"""


class NotConverged(RuntimeError):  # noqa: N818 - the name says what happened
    """The contact problem was not solved to the wanted tolerance."""


@dataclass(frozen=True, eq=False)
class Deformation:
    """The gel under a press, on the grid of the object, its centre in the middle."""

    depth_mm: Array
    """(n, n) mm, positive into the sensor, negative where the gel bulges out beside the object"""
    pressure: Array
    """(n, n) in units of the shear modulus, 0 outside the contact"""
    spacing_mm: float

    @property
    def contact(self) -> NDArray[np.bool_]:
        """(n, n) where the object touches the gel."""
        return np.asarray(self.pressure > 0)

    @cached_property
    def spline(self) -> RectBivariateSpline:
        """Cubic spline of the depth over (y, x) in mm from the object's centre."""
        at = grid(len(self.depth_mm), self.spacing_mm)
        return RectBivariateSpline(at, at, self.depth_mm, s=0)

    @cached_property
    def _coefficients(self) -> Array:
        """(n + 2, n + 2) of the B-splines that make up that spline; its ends are mirrors here."""
        return np.pad(np.asarray(spline_filter(self.depth_mm, mode="mirror")), 1, mode="reflect")

    def at(self, x: Array, y: Array, *, slopes: bool = True) -> Array:
        """Return the spline and its slopes along x and y, (3, N), at scattered points (N,) mm from the object's centre.

        The points lie on the grid. `spline` takes ten times as long for them. slopes: without, they are 0, in half the
        time.
        """
        n, coefficients = len(self.depth_mm), self._coefficients.ravel()
        (column, across, d_across), (row, down, d_down) = (
            _weights(at / self.spacing_mm + (n - 1) / 2, n) for at in (x, y)
        )
        found, first = np.zeros((3, len(x))), row * (n + 2) + column
        for i in range(4):
            taken = [coefficients.take(first + (i * (n + 2) + j)) for j in range(4)]
            value = sum(w * c for w, c in zip(across, taken, strict=True))
            found[0] += down[i] * value
            if slopes:
                found[1] += down[i] * sum(w * c for w, c in zip(d_across, taken, strict=True))
                found[2] += d_down[i] * value
        found[1:] /= self.spacing_mm
        return found


def _weights(at: Array, n: int) -> tuple[NDArray[np.intp], list[Array], list[Array]]:
    """Return the first of four B-splines at places (N,) between n points, their values and their slopes there."""
    first = np.clip(at.astype(np.intp), 0, n - 2)
    f = at - first
    g = 1 - f
    values = [g**3 / 6, 2 / 3 - f * f * (1 - f / 2), 2 / 3 - g * g * (1 - g / 2), f**3 / 6]
    return first, values, [-g * g / 2, f * (1.5 * f - 2), -g * (1.5 * g - 2), f * f / 2]


def grid(size: int, spacing_mm: float) -> Array:
    """(size,) mm: coordinates of the points around the object's centre, along either axis."""
    return np.asarray((np.arange(size) - (size - 1) / 2) * spacing_mm)


class GelModel(Protocol):
    """Presses a rigid object into the gel."""

    def __hash__(self) -> int:
        """Models can be keys: what one has computed is kept."""

    def __call__(
        self, object_height_mm: Array, spacing_mm: float, press_depth_mm: float, geometry: SensorGeometry, /
    ) -> Deformation:
        """Return the gel's surface, coated, on the grid of the object.

        `object_height_mm` (n, n) is the object's surface towards the gel, 0 at its highest point, `NO_OBJECT` beside
        it, on points `spacing_mm` apart. `press_depth_mm` is how far the highest point goes beyond first touch. Raises
        ValueError for what cannot be pressed, NotConverged where no solution was found.
        """
