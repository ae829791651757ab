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


def sample(
    deformation: Deformation, geometry: SensorGeometry, x_mm: float, y_mm: float, turn_rad: float = 0.0
) -> Surface:
    """Return the gel surface on the camera's pixels, with the object's centre at (x_mm, y_mm) from the image centre.

    `turn_rad` is how far the object is turned, from x towards y. Beyond the object's grid depth and slopes are 0. The
    ball has left 1 um of depth there, the plates of the benchmark, which displace more, up to 0.13 mm (BALLCAVE, 0.9 mm
    deep): 32 mm from the object's centre, so beyond the image unless the object is pressed more than 13 mm off centre.
    """
    if not (np.isfinite(x_mm) and np.isfinite(y_mm) and np.isfinite(turn_rad)):
        raise ValueError(f"an object cannot be placed at ({x_mm}, {y_mm}) mm, {turn_rad} rad: give finite numbers")
    x, y = pixel_grid(geometry)
    if turn_rad:
        return _turned(deformation, geometry, x, y, (x_mm, y_mm, turn_rad))
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


def depth_at(
    deformation: Deformation,
    x: Array,
    y: Array,
    x_mm: float,
    y_mm: float,
    turn_rad: float = 0.0,
    dx: int = 0,
    dy: int = 0,
) -> Array:
    """Return the depth at (...) points x, y of the gel, or its `dx`-th derivative along the object's x and `dy`-th
    along its y, with the object placed as in `sample`; 0 beyond the object's grid.
    """
    across, down = _own_axes(x - x_mm, y - y_mm, turn_rad)
    edge = grid(len(deformation.depth_mm), deformation.spacing_mm)[-1]
    inside = (np.abs(across) <= edge) & (np.abs(down) <= edge)
    depth = np.zeros(across.shape)
    depth[inside] = deformation.spline(down[inside], across[inside], dx=dy, dy=dx, grid=False)
    return depth


def _turned(
    deformation: Deformation, geometry: SensorGeometry, x: Array, y: Array, place: tuple[float, float, float]
) -> Surface:
    x, y = np.broadcast_arrays(x, y)
    depth, own_x, own_y = (depth_at(deformation, x, y, *place, dx=dx, dy=dy) for dx, dy in ((0, 0), (1, 0), (0, 1)))
    cos, sin = np.cos(place[2]), np.sin(place[2])
    slopes = np.stack([cos * own_x - sin * own_y, sin * own_x + cos * own_y], axis=2)
    across, down = _own_axes(x - place[0], y - place[1], place[2])
    points = grid(len(deformation.depth_mm), deformation.spacing_mm)
    nearest = [np.rint((at - points[0]) / deformation.spacing_mm).astype(int) for at in (down, across)]
    inside = np.logical_and.reduce([(at >= 0) & (at < len(points)) for at in nearest])
    contact = np.zeros(x.shape, bool)
    contact[inside] = deformation.contact[nearest[0][inside], nearest[1][inside]]
    return Surface(depth, slopes, contact)


def _own_axes(x: Array, y: Array, turn_rad: float) -> tuple[Array, Array]:
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    return cos * x + sin * y, cos * y - sin * x
