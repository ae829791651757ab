"""Light that enters the gel through a flat window: bent by Snell's law, weakened by Fresnel's.

Acrylic and silicone have nearly the same index, so they are one medium here. The paper leaves this out.
"""

from dataclasses import dataclass
from math import asin, sin

import numpy as np
from numpy.typing import NDArray

from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
BISECTIONS = 48
"""the angle is found to pi / 2^49"""


ACRYLIC_MM = 3.0
"""thickness of the board that supports the gel (section 3.2.1)"""


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


def window_of(geometry: SensorGeometry) -> Medium:
    """Return the gel of a sensor and the acrylic that supports it."""
    return Medium(thickness_mm=ACRYLIC_MM + geometry.gel_thickness_mm)


VACUUM = Medium(refractive_index=1.0, thickness_mm=0.0)


def refracted(angle_rad: float, medium: Medium) -> float:
    """Return the incident angle in the gel of light that has `angle_rad` in air (Snell)."""
    return asin(sin(angle_rad) / medium.refractive_index)


def transmittance(angle_rad: Array, inside_rad: Array, medium: Medium) -> Array:
    """Return the share of unpolarised light that enters, for angles in air and inside (Fresnel)."""
    index, outer, inner = medium.refractive_index, np.cos(angle_rad), np.cos(inside_rad)
    across = ((outer - index * inner) / (outer + index * inner)) ** 2
    along = ((inner - index * outer) / (inner + index * outer)) ** 2
    return np.asarray(1 - (across + along) / 2)


@dataclass(frozen=True, eq=False)
class Rays:
    """The rays from a point source at a height to points on the gel."""

    leaving_rad: Array
    """from the vertical, in air"""
    arriving_rad: Array
    """from the normal, in the gel"""
    flux: Array
    """light on a horizontal mm^2 per intensity of the source; cos / d^2 in vacuum"""


def trace(distance_mm: Array, height_mm: float, medium: Medium) -> Rays:
    """Return the rays over the horizontal `distance_mm` (P,) from a source `height_mm` above the coating.

    The flux follows from the solid angle that is spread over a ring of the surface: sin a da / (x dx), times the
    transmittance.
    """
    air = height_mm - medium.thickness_mm
    if air <= 0:
        raise ValueError(
            f"LEDs {height_mm} mm above the gel surface are inside the window of {medium.thickness_mm} mm: "
            "mount them higher above the gel or make the window thinner"
        )
    x = np.maximum(distance_mm, 1e-9)
    angle = _angle_to(x, air, medium)
    inside = np.arcsin(np.sin(angle) / medium.refractive_index)
    spread = air / np.cos(angle) ** 2
    spread = spread + medium.thickness_mm * np.cos(angle) / (medium.refractive_index * np.cos(inside) ** 3)
    return Rays(angle, inside, np.sin(angle) / (x * spread) * transmittance(angle, inside, medium))


def _angle_to(x: Array, air_mm: float, medium: Medium) -> Array:
    """Angle in air of the ray that arrives at distance x, by bisection: the distance grows with the angle."""
    if medium.refractive_index == 1:
        return np.arctan2(x, air_mm + medium.thickness_mm)
    low, high = np.zeros_like(x), np.full_like(x, np.pi / 2)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        inside = np.arcsin(np.sin(middle) / medium.refractive_index)
        short = air_mm * np.tan(middle) + medium.thickness_mm * np.tan(inside) < x
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.asarray((low + high) / 2)
