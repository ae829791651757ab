"""Light through a flat window: bent by Snell's law, weakened by Fresnel's.

Acrylic and silicone have nearly the same index, so they are one medium here. The paper leaves this out.

A ray that leaves a point with the tangent u = tan a in air, a above the window, reaches in it the sine sin a / n, so
the tangent u / s with s = sqrt(n^2 + (n^2 - 1) u^2), and after t in it the distance

    x = u (a + t / s).

x grows with u and is concave in it: Newton's method climbs to u from the paraxial x / (a + t / n). The same ray, walked
back, is that of a camera: `trace` tells where an LED's light arrives and where a pinhole looks.
"""

from dataclasses import dataclass
from functools import cached_property
from math import asin, sin

import numpy as np
from numpy.typing import NDArray

from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
MOST_STEPS, SETTLED = 8, 1e-6
"""of Newton's method, and the share of the tangent below which a step was the last: the next is its square"""


@dataclass(frozen=True, kw_only=True)
class Medium:
    """What lies between the LEDs and the coating. Index 1 is the paper's model: nothing."""

    refractive_index: float = 1.41
    thickness_mm: float

    def __post_init__(self) -> None:
        """Refuse what no window is."""
        if not (self.refractive_index >= 1 and self.thickness_mm >= 0):
            raise ValueError(
                f"index {self.refractive_index}, thickness {self.thickness_mm} mm: give an index of 1 or more and a "
                "thickness that is not negative"
            )


VACUUM = Medium(refractive_index=1.0, thickness_mm=0.0)


def window_of(geometry: SensorGeometry) -> Medium:
    """Return the gel of a sensor and the acrylic that supports it."""
    return Medium(thickness_mm=geometry.window_mm)


def medium_of(geometry: SensorGeometry) -> Medium:
    """Return what a simulated sensor is lit and seen through: its window, or nothing."""
    return window_of(geometry) if geometry.window else VACUUM


def refracted(angle_rad: float, medium: Medium) -> float:
    """Return the incident angle in the gel of light that has `angle_rad` in air (Snell)."""
    return asin(sin(angle_rad) / medium.refractive_index)


def transmittance(angle_rad: Array, inside_rad: Array, medium: Medium) -> Array:
    """Return the share of unpolarised light that enters, for angles in air and inside (Fresnel).

    It is that of light which leaves on the same way.
    """
    return _passing(np.cos(angle_rad), np.cos(inside_rad), medium.refractive_index)


def _passing(outer: Array, inner: Array, index: float) -> Array:
    """Return the share that passes for cosines of the angles in air and inside."""
    across = (outer - index * inner) / (outer + index * inner)
    along = (inner - index * outer) / (inner + index * outer)
    return np.asarray(1 - (across * across + along * along) / 2)


@dataclass(frozen=True, eq=False)
class Rays:
    """The rays from a point source at a height to points on the gel."""

    leaving_tan: Array
    """of the angle from the vertical, in air"""
    bent: Array
    """how many times greater that tangent is than the one in the gel"""
    below_mm: Array
    """how far below the source the point seems to lie, seen from the source: distance / tan of the angle in air"""
    air_mm: float
    inside_mm: Array | float
    index: float

    @cached_property
    def arriving_tan(self) -> Array:
        """Of the angle from the normal, in the gel."""
        return self.leaving_tan / self.bent

    @cached_property
    def above_mm(self) -> Array:
        """How high above the point the source seems to stand, seen from the gel: distance / tan of the angle there."""
        return self.below_mm * self.bent

    @cached_property
    def leaving_cos(self) -> Array:
        """Cosine of the angle from the vertical, in air."""
        return np.asarray(1 / np.sqrt(1 + self.leaving_tan**2))

    @cached_property
    def passing(self) -> Array:
        """Share of the light that passes the window's face."""
        return _passing(self.leaving_cos, self.leaving_cos * self.bent / self.index, self.index)

    @property
    def flux(self) -> Array:
        """Light on a mm^2 of gel per intensity of the source: what passes of sin a da / (x dx); in air cos / d^2."""
        spread = self.below_mm * _spread(self.air_mm, self.inside_mm, self.index, self.bent)
        return np.asarray(self.passing * self.leaving_cos * self.leaving_cos * self.leaving_cos / spread)

    @property
    def arriving_rad(self) -> Array:
        """Angle from the normal in the gel."""
        return np.arctan(self.arriving_tan)


def _spread(air_mm: float, inside_mm: Array | float, index: float, bent: Array) -> Array:
    """Return dx / du: how far a ray goes over the gel for a little of the tangent at which it leaves."""
    return np.asarray(air_mm + inside_mm * index**2 / (bent * bent * bent))


def trace(distance_mm: Array, height_mm: float, medium: Medium, depth_mm: Array | float = 0.0) -> Rays:
    """Return the rays over the horizontal `distance_mm` from a source `height_mm` above the coating at rest.

    The points are pressed `depth_mm` towards it. Raises ValueError for a source inside the window.
    """
    air = height_mm - medium.thickness_mm
    if air <= 0:
        raise ValueError(
            f"LEDs {height_mm} mm above the gel surface are inside the window of {medium.thickness_mm} mm: "
            "mount them higher above the gel or make the window thinner"
        )
    inside, index = medium.thickness_mm - depth_mm, medium.refractive_index
    tangent = distance_mm / (air + inside / index)
    bent = _bent(tangent, index)
    for _ in range(MOST_STEPS if index > 1 else 0):
        step = (distance_mm - tangent * (air + inside / bent)) / _spread(air, inside, index, bent)
        tangent = tangent + step
        bent = _bent(tangent, index)
        if not (np.abs(step) > SETTLED * tangent).any():
            break
    return Rays(tangent, bent, air + inside / bent, air, inside, index)


def _bent(tangent: Array, index: float) -> Array:
    """Return how many times greater the tangents u in air are than those inside, by Snell's law."""
    return np.asarray(np.sqrt(index**2 + (index**2 - 1) * tangent**2))
