"""The gel surface as the camera sees it: a press, computed on a grid around the object, placed under the pixels.

The gel is modelled as laterally uniform, so a press has the same shape wherever it happens. It is solved once on a
square grid centred on the object and sampled on the pixels by cubic splines, whose derivatives are the slopes: depth
and gradient map belong to the same smooth surface.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim_reference import gel
from sim_reference.deformation import Deformation, GelModel, grid
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.objects import ObjectParameters, object_height

Array = NDArray[np.float64]
GRID_SIZE = 512
GRID_EXTENT_MM = 64.0
"""an object 35 mm across and three gel thicknesses around it; 0.125 mm between points"""


@dataclass(frozen=True, eq=False)
class Surface:
    """The gel surface on the pixels of the camera."""

    depth_mm: Array
    """(H, W) mm, positive into the sensor"""
    gradient_map: Array
    """(H, W, 2) d(depth)/dx, d(depth)/dy"""
    contact: NDArray[np.bool_]
    """(H, W) where the object touches"""

    @cached_property
    def upright(self) -> Array:
        """(H, W) z component of the unit normal, 1 / sqrt(1 + |slope|^2)."""
        return np.asarray(1 / np.sqrt(1 + self.gradient_map[..., 0] ** 2 + self.gradient_map[..., 1] ** 2))

    def single_precision(self) -> "Surface":
        """Return the surface in float32, which halves the time to light it; the rounding is far below a grey level."""
        return Surface(self.depth_mm.astype(np.float32), self.gradient_map.astype(np.float32), self.contact)


def untouched(geometry: SensorGeometry) -> Surface:
    """Return the gel at rest."""
    shape = geometry.image_shape
    return Surface(np.zeros(shape), np.zeros((*shape, 2)), np.zeros(shape, bool))


def press_object(
    name: str,
    press_depth_mm: float,
    geometry: SensorGeometry,
    *,
    parameters: ObjectParameters | None = None,
    size: int = GRID_SIZE,
    model: GelModel = gel.press,
) -> Deformation:
    """Press object `name` into the gel by `press_depth_mm`, on a grid of `size` points a side around the object.

    `model` computes the gel. Raises ValueError for an unknown object or an impossible depth, and what `model` raises.
    """
    spacing = GRID_EXTENT_MM / size
    at = grid(size, spacing)
    height = object_height(name, at[None, :], at[:, None], parameters)
    return model(height, spacing, press_depth_mm, geometry)


def sample(deformation: Deformation, geometry: SensorGeometry, x_mm: float, y_mm: float) -> Surface:
    """Return the gel surface on the camera's pixels, with the object's centre at (x_mm, y_mm) from the image centre.

    Beyond the object's grid depth and slopes are 0. The ball has left 1 um of depth there, the plates of the benchmark,
    which displace more, up to 0.13 mm (BALLCAVE, 0.9 mm deep): 32 mm from the object's centre, so beyond the image
    unless the object is pressed more than 13 mm off centre.
    """
    if not (np.isfinite(x_mm) and np.isfinite(y_mm)):
        raise ValueError(f"an object cannot be placed at ({x_mm}, {y_mm}) mm: give finite numbers")
    x, y = pixel_grid(geometry)
    across, down = x.ravel() - x_mm, y.ravel() - y_mm
    points = grid(len(deformation.depth_mm), deformation.spacing_mm)
    columns, rows = (np.flatnonzero((at >= points[0]) & (at <= points[-1])) for at in (across, down))
    surface = untouched(geometry)
    inside = np.ix_(rows, columns)
    at_rows, at_columns, spline = down[rows], across[columns], deformation.spline
    surface.depth_mm[inside] = spline(at_rows, at_columns)
    surface.gradient_map[inside] = np.stack(
        [spline(at_rows, at_columns, dy=1), spline(at_rows, at_columns, dx=1)], axis=2
    )
    nearest = [np.rint((at - points[0]) / deformation.spacing_mm).astype(int) for at in (at_rows, at_columns)]
    surface.contact[inside] = deformation.contact[np.ix_(*nearest)]
    return surface
