"""What is pressed: the calibration ball and the ten benchmark objects of section 2.1.2, in four groups.

Every object is a surface height over (x, y) in mm, towards the gel, 0 at its highest point and negative below. The
paper states a relief of 1 mm and a region of 35 mm across; all other measures are ours, chosen so that the benchmark
reproduces the paper's best incident angle (they decide its steepness).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import radians

import numpy as np
from numpy.typing import NDArray

from sim_reference.deformation import NO_OBJECT

Array = NDArray[np.float64]
REACH_MM = 2.6
"""from its centre no form of an array goes farther"""


@dataclass(frozen=True, kw_only=True)
class ObjectParameters:
    """Measures of the objects in mm."""

    calibration_ball_radius_mm: float = 4.0
    """section 3.2.3: a ball of 8 mm diameter"""
    relief_mm: float = 1.0
    region_diameter_mm: float = 35.0
    wavelength_mm: float = 2.5
    crown_radius_mm: float = 2.0
    """base radius of the spherical crown"""
    array_ball_radius_mm: float = 1.2
    array_pitch_mm: float = 5.0
    bevel_mm: float = 0.25
    """width of the slope at the edge of polygons"""
    curves_as_prisms: bool = False
    """another reading of "curved convex": prisms with curved outlines, dense as the polygons, instead of solids"""


def ball(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return the calibration ball; below its equator there is nothing."""
    return _cap(np.hypot(x, y), p.calibration_ball_radius_mm)


def triangular_step(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return TSTEP: a triangle of inradius 6 mm that stands `relief` above a plate."""
    return _on_plate(_plateau(_inside_polygon(x, y, 3, 6.0, np.pi / 2), 1e-6), x, y, p)


def spherical_crown(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return SCROWN: the top of a sphere, `relief` high over its base circle."""
    sphere_radius = (p.crown_radius_mm**2 + p.relief_mm**2) / (2 * p.relief_mm)
    return _on_plate(np.maximum(1 + _cap(np.hypot(x, y), sphere_radius) / p.relief_mm, 0), x, y, p)


def convex_balls(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return BALLVEX: a square array of spherical caps."""
    return _on_plate(_ball_array(x, y, p), x, y, p)


def concave_balls(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return BALLCAVE: the same array as hollows."""
    return _on_plate(1 - _ball_array(x, y, p), x, y, p)


def circular_wave(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return WAVE: concentric rings."""
    return _on_plate(0.5 + 0.5 * np.cos(2 * np.pi * np.hypot(x, y) / p.wavelength_mm), x, y, p)


def sine_wave(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return SINWAVE: straight waves along x."""
    return _on_plate(0.5 + 0.5 * np.sin(2 * np.pi * (x + 0 * y) / p.wavelength_mm), x, y, p)


def sine_wave_on_sphere(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return BSWAVE: the same waves on a sphere that falls by `relief` to the edge of the region."""
    half = p.region_diameter_mm / 2
    radius = (half**2 + p.relief_mm**2) / (2 * p.relief_mm)

    def relief(r: Array, x: Array) -> Array:
        sphere = np.maximum(1 + _cap(r, radius) / p.relief_mm, 0)
        return np.asarray(sphere + 0.5 + 0.5 * np.sin(2 * np.pi * x / p.wavelength_mm))

    first_crest = np.linspace(0, p.wavelength_mm / 2, 20_001)
    return _on_plate(relief(np.hypot(x, y), x), x, y, p, highest=relief(first_crest, first_crest).max())


def convex_polygons(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return PCONVEX: polygons of three to six corners, densely packed."""
    pitch = 4.0
    inradius = {3: 1.0, 4: 1.35, 5: 1.45, 6: 1.55}
    relief = np.zeros(np.broadcast(x, y).shape)
    for row in range(-5, 6):
        for column in range(-5, 6):
            centre = pitch * (column + (row % 2) / 2), pitch * 0.87 * row
            if np.hypot(*centre) <= p.region_diameter_mm / 2 - 1.8:
                corners = 3 + (3 * column + 5 * row) % 4
                turn = 0.5 * (7 * column + 3 * row)
                box, u, v = _around(x, y, centre)
                inside = _inside_polygon(u, v, corners, inradius[corners], turn)
                relief[box] = np.maximum(relief[box], _plateau(inside, p.bevel_mm))
    return _on_plate(relief, x, y, p)


def convex_curves(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return CCONVEX: ellipsoids, half rings, cylinders and domes, sparsely placed; or prisms of their outlines."""
    pitch, scale = (4.0, 0.7) if p.curves_as_prisms else (6.2, 1.0)
    forms = (_ellipsoid, _ring, _cylinder, _dome)
    relief = np.zeros(np.broadcast(x, y).shape)
    steps = range(-int(p.region_diameter_mm / 2 / pitch), int(p.region_diameter_mm / 2 / pitch) + 1)
    for row in steps:
        for column in steps:
            centre = pitch * column, pitch * row
            if np.hypot(*centre) <= p.region_diameter_mm / 2 - 2.6 * scale:
                box, across, down = _around(x, y, centre)
                u, v = _turned(across, down, 0.7 * (column + 2 * row))
                height = forms[(5 * column + 3 * row) % 4](u / scale, v / scale)
                relief[box] = np.maximum(relief[box], height > 0 if p.curves_as_prisms else height)
    return _on_plate(relief, x, y, p)


def concave_quadrangles(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Return QUCAVE: square hollows, every other one turned by 45 degrees."""
    relief = np.ones(np.broadcast(x, y).shape)
    for row, column, centre in _array_centres(p, 2.6):
        turn = 0.0 if (row + column) % 2 else radians(45)
        box, u, v = _around(x, y, centre)
        relief[box] = np.minimum(relief[box], 1 - _plateau(_inside_polygon(u, v, 4, 1.6, turn), p.bevel_mm))
    return _on_plate(relief, x, y, p)


OBJECTS: dict[str, Callable[[Array, Array, ObjectParameters], Array]] = {
    "BALL": ball,
    "TSTEP": triangular_step,
    "SCROWN": spherical_crown,
    "BALLVEX": convex_balls,
    "BALLCAVE": concave_balls,
    "WAVE": circular_wave,
    "SINWAVE": sine_wave,
    "BSWAVE": sine_wave_on_sphere,
    "PCONVEX": convex_polygons,
    "CCONVEX": convex_curves,
    "QUCAVE": concave_quadrangles,
}
OBJECT_NAMES = tuple(OBJECTS)
BENCHMARK_NAMES = OBJECT_NAMES[1:]


def object_height(name: str, x_mm: Array, y_mm: Array, parameters: ObjectParameters | None = None) -> Array:
    """Return the surface of object `name` at x (1, W) or (H, W) and y (H, 1) or (H, W): (H, W) mm, highest point 0.

    Raises ValueError for an unknown name.
    """
    check_name(name)
    return OBJECTS[name](x_mm, y_mm, parameters or ObjectParameters())


def check_name(name: str) -> None:
    """Raise ValueError unless a name is that of an object."""
    if name not in OBJECTS:
        raise ValueError(f"no object {name!r}: choose one of {', '.join(OBJECTS)}")


def _cap(r: Array, radius: float) -> Array:
    """Height of a sphere below its top at distance r from the axis."""
    return np.where(r < radius, np.sqrt(np.maximum(radius**2 - r**2, 0)) - radius, NO_OBJECT)


def _on_plate(relief: Array, x: Array, y: Array, p: ObjectParameters, highest: float = 1.0) -> Array:
    """Scale a relief of 0..`highest` to mm, its highest point 0, on a round plate."""
    on_plate = np.hypot(x, y) < p.region_diameter_mm / 2
    return np.asarray(np.where(on_plate, p.relief_mm * (relief - highest), NO_OBJECT))


def _plateau(inside_mm: Array, bevel_mm: float) -> Array:
    """1 inside, 0 outside, with a slope of width `bevel_mm` at the edge."""
    return np.clip(inside_mm / bevel_mm, 0, 1)


def _inside_polygon(x: Array, y: Array, corners: int, inradius_mm: float, turn_rad: float) -> Array:
    """Signed distance in mm from the edges of a regular polygon, positive inside."""
    angles = turn_rad + 2 * np.pi * np.arange(corners) / corners
    return np.asarray(inradius_mm - np.max([x * np.cos(a) + y * np.sin(a) for a in angles], axis=0))


def _array_centres(p: ObjectParameters, margin_mm: float) -> list[tuple[int, int, tuple[float, float]]]:
    pitch, reach = p.array_pitch_mm, p.region_diameter_mm / 2 - margin_mm
    steps = range(-int(reach // pitch), int(reach // pitch) + 1)
    cells = [(row, column, (pitch * column, pitch * row)) for row in steps for column in steps]
    return [cell for cell in cells if np.hypot(*cell[2]) <= reach]


def _around(
    x: Array, y: Array, centre: tuple[float, float], reach_mm: float = REACH_MM
) -> tuple[tuple[slice, slice], Array, Array]:
    """Return the rows and columns that hold all within the reach of a centre, and x and y from it there."""
    u, v = x - centre[0], y - centre[1]
    rows, columns = (_span(np.abs(at).min(axis=axis) < reach_mm) for at, axis in ((v, 1), (u, 0)))
    whole = slice(1)
    return (rows, columns), u[rows if len(u) > 1 else whole, columns], v[rows, columns if v.shape[1] > 1 else whole]


def _span(marked: NDArray[np.bool_]) -> slice:
    found = np.flatnonzero(marked)
    return slice(int(found[0]), int(found[-1]) + 1) if found.size else slice(0)


def _ball_array(x: Array, y: Array, p: ObjectParameters) -> Array:
    """Spherical caps of height 1 on 0."""
    relief = np.zeros(np.broadcast(x, y).shape)
    for _, _, centre in _array_centres(p, 2.2):
        box, u, v = _around(x, y, centre, p.array_ball_radius_mm)
        relief[box] = np.maximum(relief[box], 1 + _cap(np.hypot(u, v), p.array_ball_radius_mm) / p.relief_mm)
    return relief


def _turned(x: Array, y: Array, angle_rad: float) -> tuple[Array, Array]:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return x * c + y * s, y * c - x * s


def _root(square: Array) -> Array:
    return np.sqrt(np.maximum(square, 0))


def _ellipsoid(u: Array, v: Array) -> Array:
    return _root(1 - (u / 2.2) ** 2 - (v / 1.1) ** 2)


def _ring(u: Array, v: Array) -> Array:
    return _root(1 - ((np.hypot(u, v) - 1.5) / 0.6) ** 2)


def _cylinder(u: Array, v: Array) -> Array:
    return _root(1 - v**2) * (np.abs(u) < 2)


def _dome(u: Array, v: Array) -> Array:
    return _root(1 - (u**2 + v**2) / 1.3**2)
