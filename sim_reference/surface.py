"""The gel surface as the camera sees it: a press, computed on a grid around the object, placed under the pixels.

The gel is modelled as laterally uniform, so a press has the same shape wherever it happens. It is solved once on a
square grid centred on the object and sampled on the pixels by cubic splines, whose derivatives are the slopes: depth
and gradient map belong to the same smooth surface.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim_reference import gel, view
from sim_reference.deformation import Deformation, GelModel, grid
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.objects import ObjectParameters, object_height

Array = NDArray[np.float64]
Place = tuple[float, float, float]
"""x, y mm of an object from the image centre, and its turn, rad"""
GRID_SIZE = 512
GRID_EXTENT_MM = 64.0
"""an object 35 mm across and three gel thicknesses around it; 0.125 mm between points"""
LEAST_RISING = 0.3
"""walls that are steeper along the ray stay where the ray met them between the pixels"""


@dataclass(frozen=True, eq=False)
class Surface:
    """The gel surface on the pixels of the camera."""

    depth_mm: Array
    """(H, W) mm, positive into the sensor"""
    gradient_map: Array
    """(H, W, 2) d(depth)/dx, d(depth)/dy"""
    contact: NDArray[np.bool_]
    """(H, W) where the object touches"""
    relief_mm: Array | None = None
    """(H, W) depth at the pixels' places on the gel at rest, which casts the shadows; None: it is `depth_mm`"""

    @cached_property
    def upright(self) -> Array:
        """(H, W) z component of the unit normal, 1 / sqrt(1 + |slope|^2)."""
        return np.asarray(1 / np.sqrt(1 + self.gradient_map[..., 0] ** 2 + self.gradient_map[..., 1] ** 2))

    def single_precision(self) -> "Surface":
        """Return the surface in float32, which halves the time to light it; the rounding is far below a grey level."""
        return replace(
            self, depth_mm=self.depth_mm.astype(np.float32), gradient_map=self.gradient_map.astype(np.float32)
        )


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
    """Return the gel surface that the camera's pixels see, with the object's centre at (x_mm, y_mm) from their centre.

    `turn_rad` is how far the object is turned, from x towards y. Beyond the object's grid depth and slopes are 0. The
    ball has left 1 um of depth there, the plates of the benchmark, which displace more, up to 0.13 mm (BALLCAVE, 0.9 mm
    deep): 32 mm from the object's centre, so beyond the image unless the object is pressed more than 13 mm off centre.
    """
    if not (np.isfinite(x_mm) and np.isfinite(y_mm) and np.isfinite(turn_rad)):
        raise ValueError(f"an object cannot be placed at ({x_mm}, {y_mm}) mm, {turn_rad} rad: give finite numbers")
    place = x_mm, y_mm, turn_rad
    x, y = pixel_grid(geometry)
    across, down = np.broadcast_arrays(x, y)
    at_rest = _at(deformation, across, down, place) if turn_rad else _upright(deformation, x, y, place)
    return _in_perspective(deformation, geometry, at_rest, place) if geometry.perspective else at_rest


def _upright(deformation: Deformation, x: Array, y: Array, place: Place) -> Surface:
    """Return what `_at` does on the grid of x (1, W) and y (H, 1), of an object that is not turned: faster."""
    across, down = x.ravel() - place[0], y.ravel() - place[1]
    points = grid(len(deformation.depth_mm), deformation.spacing_mm)
    columns, rows = (np.flatnonzero((at >= points[0]) & (at <= points[-1])) for at in (across, down))
    shape = len(down), len(across)
    surface = Surface(np.zeros(shape), np.zeros((*shape, 2)), np.zeros(shape, bool))
    inside = np.ix_(rows, columns)
    at_rows, at_columns, spline = down[rows], across[columns], deformation.spline
    surface.depth_mm[inside] = spline(at_rows, at_columns)
    surface.gradient_map[inside] = np.stack(
        [spline(at_rows, at_columns, dy=1), spline(at_rows, at_columns, dx=1)], axis=2
    )
    nearest = [np.rint((at - points[0]) / deformation.spacing_mm).astype(int) for at in (at_rows, at_columns)]
    surface.contact[inside] = deformation.contact[np.ix_(*nearest)]
    return surface


def _in_perspective(deformation: Deformation, geometry: SensorGeometry, at_rest: Surface, place: Place) -> Surface:
    """Return what a pinhole sees of the gel, which has the surface `at_rest` at the pixels' places on the gel at rest.

    The rays meet the surface as it lies between the pixels' places; one step of Newton's method takes them to the
    spline. Of f(d) = depth(p - d T) - d for a ray with the tangents T the derivative is -(slopes . T) - 1.
    """
    met = view.first_met(at_rest.depth_mm, geometry)
    near = view.places(met, geometry)
    slopes = [view.between(at_rest.gradient_map[..., axis], *near, geometry) for axis in (0, 1)]
    rising = 1 + (np.stack(slopes, axis=2) * view.tangents(geometry)).sum(axis=2)
    left = shape_at(deformation, *near, *place, slopes=False)[0] - met
    met += np.where(rising > LEAST_RISING, left / np.maximum(rising, LEAST_RISING), 0)
    return replace(_at(deformation, *view.places(met, geometry), place), relief_mm=at_rest.depth_mm)


def shape_at(
    deformation: Deformation, x: Array, y: Array, x_mm: float, y_mm: float, turn_rad: float = 0.0, *,
    slopes: bool = True,
) -> Array:  # fmt: skip
    """Return the depth at (...) points x, y of the gel and its slopes along x and y, (3, ...).

    The object is placed as in `sample`; beyond its grid all is 0. slopes: as `Deformation.at` has it.
    """
    across, down = _own_axes(x - x_mm, y - y_mm, turn_rad)
    edge = grid(len(deformation.depth_mm), deformation.spacing_mm)[-1]
    inside = (np.abs(across) <= edge) & (np.abs(down) <= edge)
    shape = np.zeros((3, *across.shape))
    depth, own_x, own_y = deformation.at(across[inside], down[inside], slopes=slopes)
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    shape[:, inside] = depth, cos * own_x - sin * own_y, sin * own_x + cos * own_y
    return shape


def _at(deformation: Deformation, x: Array, y: Array, place: Place) -> Surface:
    """Return the surface at (H, W) points x, y of the gel."""
    depth, *slopes = shape_at(deformation, x, y, *place)
    across, down = _own_axes(x - place[0], y - place[1], place[2])
    points = grid(len(deformation.depth_mm), deformation.spacing_mm)
    nearest = [np.rint((at - points[0]) / deformation.spacing_mm).astype(int) for at in (down, across)]
    inside = np.logical_and.reduce([(at >= 0) & (at < len(points)) for at in nearest])
    contact = np.zeros(x.shape, bool)
    contact[inside] = deformation.contact[nearest[0][inside], nearest[1][inside]]
    return Surface(depth, np.stack(slopes, axis=2), contact)


def _own_axes(x: Array, y: Array, turn_rad: float) -> tuple[Array, Array]:
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    return cos * x + sin * y, cos * y - sin * x
