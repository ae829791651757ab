"""How traction on an elastic layer, bonded to its support, moves its surface along itself.

In Fourier space, with l along the wave vector k, t across it, q = k h, K = 3 - 4 nu, and traction t as a share of
Young's modulus (the shear modulus is 1 / (2 (1 + nu)) of it):

    u_l = 2 (1 + nu) (A t_l + i B p)    u_t = 2 (1 + nu) tanh(q) / k * t_t
    A = (K + 1) (K sinh q cosh q + q) / (k N),  B = (K (K - 1) sinh^2 q - 2 q^2) / (k N),
    N = 2 K cosh 2q + 4 q^2 + 1 + K^2

p being the pressure (Johnson, Contact Mechanics, 1985, section 5.8, gives the part of the pressure; the rest follows
from the same potentials). What a cell of traction does to a point is read from these kernels in space.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gellight.reconstruction.force import Layer

Array = NDArray[np.float64]
REACH = 6.0
"""thicknesses from a cell to where nothing of it is felt any more"""
CELLS_A_THICKNESS = 20
_HALF_SPACE = 300.0
"""from this q on the exponentials would overflow"""


@dataclass(frozen=True, eq=False)
class Kernels:
    """Displacement, mm, around a cell of 1 mm2 that is pulled or pressed with the whole of Young's modulus."""

    spacing_mm: float
    middle: int
    maps: tuple[Array, Array, Array, Array, Array]
    """(n, n) each: x by a pull along x, x by one along y (as y by x), y by y; x and y by a pressure"""

    def at(self, away_mm: Array) -> tuple[Array, ...]:
        """Return them at (..., 2) points away from the cell."""
        places = np.moveaxis(away_mm[..., ::-1] / self.spacing_mm + self.middle, -1, 0)
        return tuple(map_coordinates(one, places, order=1) for one in self.maps)


@lru_cache(maxsize=8)
def kernels(layer: Layer) -> Kernels:
    """Return the kernels of a layer."""
    spacing = layer.thickness_mm / CELLS_A_THICKNESS
    middle = round(REACH * CELLS_A_THICKNESS)
    size = scipy.fft.next_fast_len(2 * middle + 1, real=True)
    kx = 2 * np.pi * scipy.fft.rfftfreq(size, spacing)[None, :]
    ky = 2 * np.pi * scipy.fft.fftfreq(size, spacing)[:, None]
    k = np.hypot(kx, ky)
    k[0, 0] = 1.0
    along, mixed, across = _compliances(k, layer)
    cos, sin = kx / k, ky / k
    xx, yy = along * cos**2 + across * sin**2, along * sin**2 + across * cos**2
    xy, xz, yz = (along - across) * cos * sin, 1j * mixed * cos, 1j * mixed * sin
    xx[0, 0] = yy[0, 0] = layer.thickness_mm * 2 * (1 + layer.poisson_ratio)
    for odd in (xy, xz, yz):
        odd[0, 0] = 0
    pushed = [np.fft.fftshift(scipy.fft.irfft2(one, s=(size, size))) / spacing**2 for one in (xx, xy, yy, xz, yz)]
    return Kernels(spacing, size // 2, (pushed[0], pushed[1], pushed[2], pushed[3], pushed[4]))


def _compliances(k: Array, layer: Layer) -> tuple[Array, Array, Array]:
    nu = layer.poisson_ratio
    q, kappa = np.minimum(k * layer.thickness_mm, _HALF_SPACE), 3 - 4 * nu
    decay = np.exp(-2 * q)
    whole = k * (2 * kappa * (1 + decay**2) / 2 + (4 * q**2 + 1 + kappa**2) * decay)
    along = (kappa + 1) * (kappa * (1 - decay**2) / 4 + q * decay) / whole
    mixed = (kappa * (kappa - 1) * (1 - decay) ** 2 / 4 - 2 * q**2 * decay) / whole
    scale = 2 * (1 + nu)
    return scale * along, scale * mixed, scale * np.tanh(q) / k
