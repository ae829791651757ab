"""The gel dragged sideways: the bonded layer of `gel.py` under traction in all three directions, and friction.

Axes of GelLight: z points into the sensor, towards the support. Traction t is the force per area on the gel, in units
of the shear modulus mu; a pressure is t_z > 0. In Fourier space, l along the wave vector k = k (c, s), t across it:

    u_t = tanh(q) / k * t_t                                        q = k h
    u_l = A t_l + i B t_z                                          N = 2 K cosh 2q + 4 q^2 + 1 + K^2,  K = 3 - 4 nu
    u_z = D t_z - i B t_l

    A = (K + 1) (K sinh q cosh q + q) / (k N)                      D = (K + 1) (K sinh q cosh q - q) / (k N)
    B = (K (K - 1) sinh^2 q - 2 q^2) / (k N)

which follows from the Papkovich-Neuber solution with harmonic functions sinh and cosh that is 0 at the support; D is
G(k) of `gel.py`. Deep (q to infinity) A = D = (1 - nu) / k and B = (1 - 2 nu) / (2 k): Cerruti and Boussinesq. Shallow
A = tanh(q) / k = h: simple shear.

Friction is Coulomb's: |t| <= coefficient * p, and where the gel slips on the object t has that length and points along
the slip. Of all such tractions the true one makes t.C t / 2 - t.b least, b being where the object would carry the gel
(Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, 1990). What shear does to the pressure is left out
(Goodman's approximation; exact for an incompressible half space).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from sim_reference.deformation import NotConverged

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
HALF_SPACE = 300.0
"""from this q on the exponentials would overflow, and the layer is a half space"""


def compliances(k: Array, thickness_mm: float, poisson_ratio: float) -> tuple[Array, Array, Array, Array]:
    """Return A, B, D and tanh(q) / k of the module's text for (...) k > 0 in rad/mm, in mm per shear modulus."""
    q, kappa = np.minimum(k * thickness_mm, HALF_SPACE), 3 - 4 * poisson_ratio
    decay = np.exp(-2 * q)  # everything is divided by exp(2 q) / 4
    both, square = 1 - decay**2, (1 - decay) ** 2  # sinh q cosh q, sinh^2 q
    whole = 4 * kappa * (1 + decay**2) + (16 * q**2 + 4 * (1 + kappa**2)) * decay
    along = (kappa + 1) * (kappa * both + 4 * q * decay) / (k * whole)
    mixed = (kappa * (kappa - 1) * square - 8 * q**2 * decay) / (k * whole)
    normal = (kappa + 1) * (kappa * both - 4 * q * decay) / (k * whole)
    return along, mixed, normal, np.tanh(q) / k


@dataclass(frozen=True)
class Layer:
    """A bonded layer on a periodic grid of (rows, columns) points.

    Keep four thicknesses free around what touches: nearly incompressible, it carries shear that far.
    """

    shape: tuple[int, int]
    spacing_mm: float
    thickness_mm: float
    poisson_ratio: float

    @cached_property
    def _tensor(self) -> tuple[Array, Array, Array, Array, Array, Array]:
        """xx, xy, yy, zz and the imaginary parts of xz and yz on the grid of a real FFT."""
        kx = 2 * np.pi * scipy.fft.rfftfreq(self.shape[1], self.spacing_mm)[None, :]
        ky = 2 * np.pi * scipy.fft.fftfreq(self.shape[0], self.spacing_mm)[:, None]
        k = np.hypot(kx, ky)
        k[0, 0] = 1.0
        along, mixed, normal, across = compliances(k, self.thickness_mm, self.poisson_ratio)
        cos, sin = kx / k, ky / k
        xx, yy = along * cos**2 + across * sin**2, along * sin**2 + across * cos**2
        xy, xz, yz = (along - across) * cos * sin, mixed * cos, mixed * sin
        xx[0, 0] = yy[0, 0] = self.thickness_mm
        compression = (1 - 2 * self.poisson_ratio) / (2 * (1 - self.poisson_ratio))
        normal[0, 0], xy[0, 0] = self.thickness_mm * compression, 0.0
        for odd in (xy, xz, yz):  # The highest frequency of an even grid has no sign.
            odd[self.shape[0] // 2] *= self.shape[0] % 2
            odd[:, -1] *= self.shape[1] % 2
        return xx, xy, yy, normal, xz, yz

    @cached_property
    def influence(self) -> Array:
        """(3, rows, columns) xx, xy, yy: how far a unit traction on one point moves the others."""
        return np.asarray(scipy.fft.irfft2(np.stack(self._tensor[:3]), s=self.shape))

    def displacement(self, traction: Array) -> Array:
        """Return (rows, columns, 3) mm of the surface under (rows, columns, 3) traction per shear modulus."""
        xx, xy, yy, zz, xz, yz = self._tensor
        x, y, z = np.moveaxis(scipy.fft.rfft2(traction, axes=(0, 1)), 2, 0)
        moved = [xx * x + xy * y + 1j * xz * z, xy * x + yy * y + 1j * yz * z, zz * z - 1j * (xz * x + yz * y)]
        return np.asarray(scipy.fft.irfft2(np.stack(moved, axis=2), s=self.shape, axes=(0, 1)))

    def sheared(self, traction: Array) -> Array:
        """Return (rows, columns, 2) mm along the gel under (rows, columns, 2) traction along the gel."""
        xx, xy, yy = self._tensor[:3]
        x, y = np.moveaxis(scipy.fft.rfft2(traction, axes=(0, 1)), 2, 0)
        moved = np.stack([xx * x + xy * y, xy * x + yy * y], axis=2)
        return np.asarray(scipy.fft.irfft2(moved, s=self.shape, axes=(0, 1)))

    def pressed(self, pressure: Array) -> Array:
        """Return (rows, columns, 2) mm by which a pressure alone moves the surface along the gel."""
        xz, yz = self._tensor[4:]
        z = 1j * scipy.fft.rfft2(pressure)
        return np.asarray(scipy.fft.irfft2(np.stack([xz * z, yz * z], axis=2), s=self.shape, axes=(0, 1)))


@dataclass(frozen=True, eq=False)
class Dragged:
    """The gel under an object that moved sideways."""

    traction: Array
    """(rows, columns, 2) on the gel, per shear modulus"""
    displacement_mm: Array
    """(rows, columns, 2) of the surface along the gel, with what the pressure moves"""
    offset_mm: Array
    """(rows, columns, 2) displacement minus the object's motion: where it changes from step to step, the gel slips"""
    sticks: NDArray[np.bool_]
    """(rows, columns) where the gel is touched and did not slip in this step"""


def at_rest(pressure: Array, layer: Layer) -> Dragged:
    """Return the gel as a press without friction leaves it, before the object moves sideways."""
    moved = layer.pressed(pressure)
    return Dragged(np.zeros_like(moved), moved, moved, np.asarray(pressure > 0))


def drag(
    before: Dragged,
    pressure: Array,
    motion_mm: Array,
    friction: float,
    layer: Layer,
    *,
    tolerance: float = 1e-5,
    max_iterations: int = 3000,
) -> Dragged:
    """Move the object sideways to `motion_mm` (rows, columns, 2), counted from the press, and return the gel.

    `before` is the gel before this step (`at_rest` for the first one); steps along one straight path may be as long
    as wanted, a path that turns needs steps. `pressure` (rows, columns) is per shear modulus, `friction` its
    coefficient. `rigid_motion` makes motions. The iteration, projected gradients with the momentum of Nesterov that
    restarts where it points uphill (O'Donoghue and Candes, 2015), ends when the traction changes by less than
    `tolerance` of itself; NotConverged otherwise.
    """
    limit, own = friction * pressure, layer.pressed(pressure)
    wanted = (motion_mm + before.offset_mm - own) * (limit > 0)[..., None]
    window = _Window(layer, limit > 0)
    traction = np.zeros_like(wanted)
    traction[window.cut] = _slipped(
        _within(before.traction, limit)[window.cut], limit[window.cut], wanted[window.cut], window,
        tolerance, max_iterations,
    )  # fmt: skip
    moved = layer.sheared(traction) + own
    return Dragged(traction, moved, moved - motion_mm, _sticking(traction, limit))


def _slipped(
    traction: Array, limit: Array, wanted: Array, window: "_Window", tolerance: float, max_iterations: int
) -> Array:
    """Return the traction (rows, columns, 2) of `drag` in a window, beginning with `traction`."""
    ahead, momentum, step = traction, 1.0, 1 / window.stiffest_mm
    for _ in range(max_iterations):
        updated = _within(ahead - step * (window.sheared(ahead) - wanted), limit)
        change = updated - traction
        downhill = float(((ahead - updated) * change).sum()) <= 0
        following = (1 + np.sqrt(1 + 4 * momentum**2)) / 2 if downhill else 1.0
        ahead = updated + ((momentum - 1) / following if downhill else 0.0) * change
        traction, momentum = updated, following
        if np.linalg.norm(change) <= tolerance * np.linalg.norm(traction):
            return traction
    raise NotConverged(f"the traction still changes after {max_iterations} iterations: take a coarser grid")


class _Window:
    """The rows and columns around a contact: how its points move each other, without the rest of the grid."""

    def __init__(self, layer: Layer, touched: NDArray[np.bool_]) -> None:
        rows, down, height = _span(np.asarray(touched.any(axis=1)))
        columns, along, width = _span(np.asarray(touched.any(axis=0)))
        self.cut, self._padded = (rows, columns), (height, width)
        influence = np.zeros((3, height, width))
        influence[:, down[:, None], along] = layer.influence[:, down[:, None], along]
        self._touched = touched[self.cut]
        self._shape = self._touched.shape
        # It is the same to both sides of a point, so its transform is real.
        self._tensor = scipy.fft.rfft2(influence).real
        self.stiffest_mm = min(self._most_mm(np.abs(influence)), layer.thickness_mm)
        """no traction in the contact, however distributed, moves it by more than this times the traction"""

    def sheared(self, traction: Array) -> Array:
        """Return what `Layer.sheared` does, within the window."""
        (xx, xy, yy), (x, y) = self._tensor, scipy.fft.rfft2(np.moveaxis(traction, 2, 0), s=self._padded)
        moved = scipy.fft.irfft2(np.stack([xx * x + xy * y, xy * x + yy * y]), s=self._padded)
        return np.asarray(np.moveaxis(moved[:, : self._shape[0], : self._shape[1]], 0, 2))

    def _most_mm(self, influence: Array) -> float:
        """Return the largest sum of a row of the matrix of influences, which none of its eigenvalues exceeds."""
        transformed = scipy.fft.rfft2(influence) * scipy.fft.rfft2(self._touched, s=self._padded)
        xx, xy, yy = scipy.fft.irfft2(transformed, s=self._padded)[:, : self._shape[0], : self._shape[1]]
        return float(np.max(np.maximum(xx + xy, xy + yy), initial=0.0, where=self._touched)) or 1.0


def _span(touched: NDArray[np.bool_]) -> tuple[slice, NDArray[np.intp], int]:
    """Return where a contact lies along an axis, how far two of its points may be apart, and the size to compute on.

    The size holds every distance once; where the contact is as wide as half the grid, it is the grid, with its period.
    """
    at, size = np.flatnonzero(touched), len(touched)
    first, last = (int(at[0]), int(at[-1])) if len(at) else (0, 0)
    padded = scipy.fft.next_fast_len(2 * (last - first) + 1, real=True)
    if padded >= size:
        return slice(0, size), np.arange(size), size
    return slice(first, last + 1), np.arange(first - last, last - first + 1), padded


def rigid_motion(x: Array, y: Array, motion: tuple[float, float, float]) -> Array:
    """Return (rows, columns, 2) mm by which a motion (x mm, y mm, turn rad from x to y about 0) moves (x, y) mm."""
    along_x, along_y, turn = motion
    cos, sin = np.cos(turn) - 1, np.sin(turn)
    return np.stack(np.broadcast_arrays(along_x + cos * x - sin * y, along_y + sin * x + cos * y), axis=-1)


def _within(traction: Array, limit: Array) -> Array:
    """Shorten tractions to what friction holds."""
    length = np.hypot(traction[..., 0], traction[..., 1])
    share = np.divide(limit, length, out=np.ones_like(limit), where=length > limit)
    return np.asarray(traction * share[..., None])


def _sticking(traction: Array, limit: Array) -> NDArray[np.bool_]:
    return np.asarray((limit > 0) & (np.hypot(traction[..., 0], traction[..., 1]) < limit * (1 - 1e-9)))
