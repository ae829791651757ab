"""The traction along the gel that moves its dots as they have moved.

How traction on an elastic layer, bonded to its support, moves its surface along itself: in Fourier space, with l along
the wave vector k, t across it, q = k h, K = 3 - 4 nu, and traction t as a share of Young's modulus (the shear modulus
is 1 / (2 (1 + nu)) of it):

    u_l = 2 (1 + nu) (A t_l + i B p)    u_t = 2 (1 + nu) tanh(q) / k * t_t
    A = (K + 1) (K sinh q cosh q + q) / (k N),  B = (K (K - 1) sinh^2 q - 2 q^2) / (k N),
    N = 2 K cosh 2q + 4 q^2 + 1 + K^2

p being the pressure (Johnson, Contact Mechanics, 1985, section 5.8, gives the part of the pressure; the rest follows
from the same potentials). What a cell of traction does to a point is read from these kernels in space.

The traction under the contact is sought as t = p m: friction holds no more than a share m of the pressure p (Coulomb).
Before the dots are looked at, m is taken for a normal variable: a part that is the same all over the contact, parts
that grow with x and y, by which the contact can be twisted and stretched, and a part that is free in each cell. With
the linear layer the most probable traction, and the covariance of its sums, follow in closed form (Rasmussen and
Williams, Gaussian Processes for Machine Learning, 2006, equations 2.11 and 2.12).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.force import Layer

Array = NDArray[np.float64]
REACH = 6.0
"""thicknesses from a cell to where nothing of it is felt any more"""
CELLS_A_THICKNESS = 20  # measured: motions of dots then agree with the simulator's to 0.15 um
_HALF_SPACE = 300.0
"""from this q on the exponentials would overflow"""
SAME, GROWING, FREE = 0.5, 0.25, 0.15
"""standard deviations of the three parts of m"""


@dataclass(frozen=True, eq=False)
class Kernels:
    """Displacement, mm, around a cell of 1 mm2 that is pulled or pressed with the whole of Young's modulus."""

    spacing_mm: float
    middle: int
    maps: tuple[Array, Array, Array, Array, Array]
    """(n, n) each: x by a pull along x, x by one along y (as y by x), y by y; x and y by a pressure"""

    def at(self, away_mm: Array) -> tuple[Array, ...]:
        """Return them at (..., 2) points away from the cell."""
        from scipy.ndimage import map_coordinates  # SciPy takes longer than all else of a start

        places = np.moveaxis(away_mm[..., ::-1] / self.spacing_mm + self.middle, -1, 0)
        return tuple(map_coordinates(one, places, order=1) for one in self.maps)


@lru_cache(maxsize=8)
def kernels(layer: Layer) -> Kernels:
    """Return the kernels of a layer."""
    from scipy import fft

    spacing = layer.thickness_mm / CELLS_A_THICKNESS
    middle = round(REACH * CELLS_A_THICKNESS)
    size = fft.next_fast_len(2 * middle + 1, real=True)
    kx = 2 * np.pi * fft.rfftfreq(size, spacing)[None, :]
    ky = 2 * np.pi * fft.fftfreq(size, spacing)[:, None]
    k = np.hypot(kx, ky)
    k[0, 0] = 1.0
    along, mixed, across = _compliances(k, layer)
    cos, sin = kx / k, ky / k
    xx, yy = along * cos**2 + across * sin**2, along * sin**2 + across * cos**2
    xy, xz, yz = (along - across) * cos * sin, 1j * mixed * cos, 1j * mixed * sin
    xx[0, 0] = yy[0, 0] = layer.thickness_mm * 2 * (1 + layer.poisson_ratio)
    for odd in (xy, xz, yz):
        odd[0, 0] = 0
    pushed = [np.fft.fftshift(fft.irfft2(one, s=(size, size))) / spacing**2 for one in (xx, xy, yy, xz, yz)]
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Pull:
    """What pulls the gel along itself, as a share of Young's modulus."""

    traction: Array
    """(m, 2) of each cell"""
    total: Array
    """(3,) x, y (mm2) and torque about the centre of the pressure (mm3)"""
    covariance: Array
    """(3, 3) of `total`"""


def find_pull(
    moved_mm: Array, error_mm: float, influence: Array, pressure: Array, cells_mm: Array, area_mm2: float
) -> Pull:
    """Return the traction that moves n dots by (n, 2) mm, each known to `error_mm`.

    influence: (2n, 2m) mm by the traction of each cell, x of all dots before y, x of all cells before y. pressure: (m,)
    as a share of Young's modulus, above 0. cells_mm: (m, 2) their middles.
    """
    from scipy import linalg

    shapes, spread = _shapes(pressure, cells_mm)
    whole = np.concatenate([pressure, pressure])
    by_shape, by_cell = sums_along(influence, shapes), influence * whole
    short = by_cell.astype(np.float32)  # 7 digits are plenty, in a third of the time
    together = sums_along(by_shape * spread, by_shape) + FREE**2 * sums_along(short, short)
    together[np.diag_indices_from(together)] += error_mm**2
    factor = linalg.cho_factor(together, lower=True, check_finite=False)
    sums = _sums(pressure, cells_mm) * area_mm2
    weights = linalg.cho_solve(factor, moved_mm.T.ravel(), check_finite=False)
    traction = (spread * (weights @ by_shape)) @ shapes + FREE**2 * whole * np.einsum("i,ij->j", weights, by_cell)
    of_shapes, of_cells = sums_along(sums, shapes), sums * whole
    seen = sums_along(of_shapes * spread, by_shape) + FREE**2 * sums_along(of_cells, by_cell)
    before = sums_along(of_shapes * spread, of_shapes) + FREE**2 * sums_along(of_cells, of_cells)
    left = before - seen @ linalg.cho_solve(factor, seen.T, check_finite=False)
    return Pull(traction=traction.reshape(2, -1).T, total=sums @ traction, covariance=left)


def sums_along(rows: Array | NDArray[np.float32], others: Array | NDArray[np.float32]) -> Array:
    """Return rows @ others.T, in this thread alone: threads of BLAS would spin between two frames."""
    return np.asarray(np.einsum("ik,jk->ij", rows, others), np.float64)


def _shapes(pressure: Array, cells_mm: Array) -> tuple[Array, Array]:
    """Return (6, 2m) tractions of m = 1, x and y in both directions, and (6,) their variances."""
    centre = np.average(cells_mm, axis=0, weights=pressure)
    away = cells_mm - centre
    reach = np.sqrt(np.average((away**2).sum(axis=1), weights=pressure)) + 0.3
    one = np.stack([pressure, pressure * away[:, 0] / reach, pressure * away[:, 1] / reach])
    spread = np.array([SAME, GROWING, GROWING] * 2) ** 2
    return np.kron(np.eye(2), one), spread


def _sums(pressure: Array, cells_mm: Array) -> Array:
    """(3, 2m) that make x, y and the torque about the centre of the pressure of (2m,) tractions."""
    away = cells_mm - np.average(cells_mm, axis=0, weights=pressure)
    nothing, one = np.zeros(len(pressure)), np.ones(len(pressure))
    rows = [(one, nothing), (nothing, one), (-away[:, 1], away[:, 0])]
    return np.array([np.concatenate(row) for row in rows])
