"""One picture of one light on the evaluated pixels: Lambert, exposure, noise, 8 bit.

Noise is drawn from the object, the light and the incident angle, not from the order of the work: the same light gives
the same picture whichever group of lights it is used in, and whoever computes it.
"""

from dataclasses import dataclass
from fractions import Fraction
from math import radians

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WHITE = 255.0


@dataclass(frozen=True, kw_only=True)
class LightGroups:
    """The light groups of section 2.3.1 and the camera that sees them."""

    numbers: tuple[int, ...] = (3, 6, 9, 12, 15, 18, 21)
    angles_rad: tuple[float, ...] = tuple(radians(angle) for angle in range(5, 86, 8))
    cast_shadows: bool = True
    full_scale_grey: float = 255.0
    """grey level of a surface that faces the light"""
    noise_grey: float = 1.0
    quantised: bool = True
    """8 bit; without, levels are neither rounded nor clipped"""
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse groups from which no normal follows."""
        if not self.numbers or min(self.numbers) < 3:
            raise ValueError(f"numbers of lights {self.numbers}: photometric stereo needs at least 3")
        if not self.angles_rad or not 0 < min(self.angles_rad) <= max(self.angles_rad) < np.pi / 2:
            raise ValueError(f"incident angles {self.angles_rad} rad: they must lie between 0 and pi / 2")
        if not (self.full_scale_grey > 0 and self.noise_grey >= 0):
            raise ValueError(
                f"full scale {self.full_scale_grey} must be positive, noise {self.noise_grey} not negative"
            )


def ring_azimuths(number: int) -> list[Fraction]:
    """Return the azimuths of a group of lights in turns, exactly, so that rings know which lights they share."""
    return [Fraction(light, number) for light in range(number)]


def expose(light: Array, groups: LightGroups, noise_key: tuple[int, ...]) -> Array:
    """Return grey levels (P,) of what has the brightness `light` (P,); `noise_key` names the picture."""
    grey = light * groups.full_scale_grey
    if groups.noise_grey:
        rng = np.random.Generator(np.random.SFC64((groups.seed, *noise_key)))
        grey += groups.noise_grey * rng.standard_normal(grey.shape, dtype=np.float32)
    if groups.quantised:
        np.rint(grey, out=grey)
        np.clip(grey, 0, WHITE, out=grey)
    return grey


def picture_key(object_index: int, azimuth: Fraction, angle_rad: float) -> tuple[int, ...]:
    """Return the numbers that name the picture of one light."""
    return object_index, azimuth.numerator, azimuth.denominator, round(np.degrees(angle_rad) * 1000)
