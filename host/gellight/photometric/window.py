"""Light that comes to the gel through a flat window: bent by Snell's law, weakened by Fresnel's.

A ray of the tangent u in air has u / s in the window, s = sqrt(n^2 + (n^2 - 1) u^2), and so reaches the distance
u (a + t / s) from a source that stands a above a window of which t lies above the point. Seen from the source the point
seems to lie b = a + t / s below it, and seen from the point the source b s above.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
INDEX = 1.41
"""of silicone; acrylic has 1.49, so nearly the same"""
ACRYLIC_MM, GEL_MM, CAMERA_MM = 3.0, 5.0, 40.0
"""as in the paper: thickness of the board that supports the gel, of the gel, and how high the camera stands above it"""
MOST_STEPS, SETTLED = 8, 1e-6
"""of Newton's method, which climbs to u, and the share of u below which a step was the last: the next is its square"""


def window_of(geometry: Mapping[str, Any]) -> float:
    """Return how thick gel and acrylic of [geometry] are, mm; 0 where light is to go straight."""
    return ACRYLIC_MM + geometry.get("gel_thickness_mm", GEL_MM) if geometry.get("window") else 0.0


def seen_height_mm(geometry: Mapping[str, Any]) -> float:
    """Return how high above the gel the camera of [geometry] seems to stand from within the gel.

    That is h in air, n (h - t) + t behind a window of thickness t near the axis; infinite where nobody tells h, and
    where the gel is to be seen along parallel rays.
    """
    if not geometry.get("perspective", "camera_height_mm" in geometry):
        return inf
    height, window = geometry.get("camera_height_mm", CAMERA_MM), window_of(geometry)
    return float(INDEX * (height - window) + window if window else height)


@dataclass(frozen=True, eq=False)
class Bent:
    """Rays from a source to points."""

    below_mm: Floats
    above_mm: Floats
    cosine: Floats
    """of the angle from the vertical, in air"""
    flux: Floats
    """light on a level mm^2 per intensity of the source"""


def bent(distance_mm: Floats, air_mm: Any, inside_mm: Floats) -> Bent:
    """Return the rays to points (N,) at a distance along the gel, `inside_mm` below the window's face."""
    tangent = distance_mm / (air_mm + inside_mm / INDEX)
    squared, s = _bent(tangent)
    for _ in range(MOST_STEPS):
        slope = air_mm + inside_mm * (INDEX**2 / (squared * s))
        step = (distance_mm - tangent * (air_mm + inside_mm / s)) / slope
        tangent = tangent + step
        squared, s = _bent(tangent)
        if not (np.abs(step) > SETTLED * tangent).any():
            break
    below, outer = air_mm + inside_mm / s, 1 / np.sqrt(1 + tangent**2)
    flux = _passing(outer, outer * s / INDEX) * (outer * outer * outer)
    flux = flux / (below * (air_mm + inside_mm * (INDEX**2 / (squared * s))))
    return Bent(below, below * s, outer, flux)


def _bent(tangent: Floats) -> tuple[Floats, Floats]:
    """Return s^2 and s for the tangents u in air."""
    squared = INDEX**2 + (INDEX**2 - 1) * tangent**2
    return squared, np.sqrt(squared)


def _passing(outer: Floats, inner: Floats) -> Floats:
    """Return the share of unpolarised light that enters, by the cosines of its angles in air and inside."""
    across = (outer - INDEX * inner) / (outer + INDEX * inner)
    along = (inner - INDEX * outer) / (inner + INDEX * outer)
    return np.asarray(1 - (across * across + along * along) / 2)
