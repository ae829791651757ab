"""The simulated gel along its surface, under an object that was pressed into it and then moved sideways.

The press is without friction, the motion after it with Coulomb's: `sim_reference.fem.tangential`. It is computed on a
grid that lies in the gel; where the object slides, its pressure moves over the gel by as much as the gel slips on
average.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, shift

from sim_reference.deformation import Deformation
from sim_reference.fem.tangential import Dragged, Layer, at_rest, drag, rigid_motion
from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
Motion = tuple[float, float, float]
"""x, y mm from where the object was pressed, and how far it is turned, rad, from x towards y"""
COARSER = 2
"""points of the press are put together to one, as long a side"""
MARGIN = 4.0
"""gel thicknesses around the contact: a layer that hardly changes its volume carries shear that far"""
TOLERANCE = 1e-4  # chosen: share by which the last iteration still changes the pressure
KEPT = 64  # chosen: drags; the next step of a way begins where the last one ended


@dataclass(frozen=True, eq=False)
class Sheared:
    """The gel along its surface, on a grid around the object."""

    pressure: Array
    """(n, m) per shear modulus"""
    layer: Layer
    corner_mm: Array
    """(2,) x, y of the grid's first point from the middle of the imprint"""
    slid_mm: Array
    """(2,) by which the imprint has moved over the gel"""
    gel: Dragged

    @property
    def points_mm(self) -> tuple[Array, Array]:
        """(n, m) x and y from the middle of the imprint."""
        rows, columns = (np.arange(size) * self.layer.spacing_mm for size in self.pressure.shape)
        x, y = np.meshgrid(columns + self.corner_mm[0], rows + self.corner_mm[1])
        return x, y

    def sampled(self, values: Array, x_mm: Array, y_mm: Array, order: int = 1) -> Array:
        """Return (n, m) values at points of the gel at rest, mm from where the object was pressed; 0 beyond."""
        at = [y_mm - self.slid_mm[1] - self.corner_mm[1], x_mm - self.slid_mm[0] - self.corner_mm[0]]
        return np.asarray(map_coordinates(values, np.array(at) / self.layer.spacing_mm, order=order, prefilter=False))

    def moved_mm(self, x_mm: Array, y_mm: Array) -> Array:
        """Return (..., 2) how the gel at such points has moved."""
        both = (self.gel.displacement_mm[..., axis] for axis in (0, 1))
        return np.stack([self.sampled(one, x_mm, y_mm) for one in both], axis=-1)

    def force(self) -> tuple[float, float, float]:
        """Return x, y (mm2 per shear modulus) and the torque about the centre of the pressure (mm3)."""
        cell, (x, y) = self.layer.spacing_mm**2, self.points_mm
        pulled, total = self.gel.traction, max(float(self.pressure.sum()), 1e-30)
        arm_x, arm_y = (at - float((self.pressure * at).sum()) / total for at in (x, y))
        torque = float((arm_x * pulled[..., 1] - arm_y * pulled[..., 0]).sum()) * cell
        along_x, along_y = (pulled.sum(axis=(0, 1)) * cell).tolist()
        return along_x, along_y, torque

    @property
    def sticking_share(self) -> float:
        """Of the contact."""
        return float(self.gel.sticks.sum() / max((self.pressure > 0).sum(), 1))


@lru_cache(maxsize=KEPT)
def sheared(pressed: Deformation, geometry: SensorGeometry, friction: float, path: tuple[Motion, ...]) -> Sheared:
    """Return the gel after an object that was pressed went along `path`, straight from each motion to the next."""
    if not path:
        return _pressed(pressed, geometry)
    before = sheared(pressed, geometry, friction, path[:-1])
    motion = rigid_motion(*before.points_mm, path[-1])
    gel = drag(before.gel, before.pressure, motion, friction, before.layer, tolerance=TOLERANCE)
    slid = np.average((before.gel.offset_mm - gel.offset_mm)[before.pressure > 0], axis=0,
                      weights=before.pressure[before.pressure > 0])  # fmt: skip
    kept = _carried(gel, slid / before.layer.spacing_mm)
    return Sheared(before.pressure, before.layer, before.corner_mm, before.slid_mm + slid, kept)


def _pressed(pressed: Deformation, geometry: SensorGeometry) -> Sheared:
    size, spacing = len(pressed.pressure) // COARSER, pressed.spacing_mm * COARSER
    pressure = pressed.pressure[: size * COARSER, : size * COARSER]
    pressure = pressure.reshape(size, COARSER, size, COARSER).mean(axis=(1, 3))
    margin = round(MARGIN * geometry.gel_thickness_mm / spacing)
    window, corner = [], []
    for axis in (1, 0):
        touched = np.flatnonzero(pressure.any(axis=axis))
        first, last = (int(touched[0]), int(touched[-1])) if touched.size else (size // 2, size // 2)
        begin = max(first - margin, 0)
        length = scipy.fft.next_fast_len(min(last + margin + 1, size) - begin, real=True)
        window.append(slice(begin, begin + length))
        corner.append((begin - (size - 1) / 2) * spacing)
    whole = np.pad(pressure, ((0, margin), (0, margin)))[window[0], window[1]]
    layer = Layer((whole.shape[0], whole.shape[1]), spacing, geometry.gel_thickness_mm, geometry.poisson_ratio)
    return Sheared(whole, layer, np.array(corner[::-1]), np.zeros(2), at_rest(whole, layer))


def _carried(gel: Dragged, slid_points: Array) -> Dragged:
    """Return the gel as the grid of the object sees it after the object slid by so many points over it."""
    if np.abs(slid_points).max() < 1e-3:
        return gel
    back = (-slid_points[1], -slid_points[0], 0.0)
    return Dragged(gel.traction, gel.displacement_mm, shift(gel.offset_mm, back, order=1, mode="nearest"), gel.sticks)
