"""Depth map to force: the gel as an elastic layer, which one modulus makes stiff or soft.

Under a normal pressure p a layer of thickness h, bonded to its support, has the depth u whose Fourier transform is

    u(k) = G(k) p(k)
    G(k) = 2 (1 - nu^2) / (E k) * (kappa sinh 2q - 2q) / (kappa cosh 2q + 2q^2 + (1 + kappa^2) / 2)

with q = k h, kappa = 3 - 4 nu, and G(0) = h (1 + nu) (1 - 2 nu) / (E (1 - nu)) (Johnson, Contact Mechanics, 1985,
section 5.8). The depth is measured, so p is found backwards: where the gel is pressed, p is at least 0 and makes the
measured depth; elsewhere p is 0. That p makes p G p / 2 - u p least. The gradient method of Polonsky and Keer (Wear
231, 1999) finds it in about ten steps, on cells of a tenth of the thickness. The force is the integral of p.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.measures import BEYOND_VIEW, HEAVIER, Force
from gellight.frames.pixel_grid import block_means, bounding_box, spread_blocks
from gellight.reconstruction.contact import THRESHOLD_MM

Array = NDArray[np.float64]

CELLS_A_THICKNESS = 10
HEAVIER_BY = 1.25
"""a force larger than this multiple of the heaviest of the calibration is flagged"""
MARGIN = 3.0
"""thicknesses of gel around the touch: the transform repeats it, and its neighbours must not be felt"""
_MOST_STEPS = 100
_SETTLED = 1e-4
"""change of the pressure in one step, as a share of all of it"""
_HALF_SPACE = 30.0
"""from this q on a layer is a half space to 1e-13, and sinh would overflow"""


@dataclass(frozen=True)
class Layer:
    """A soft layer on a rigid support."""

    thickness_mm: float
    poisson_ratio: float

    def __post_init__(self) -> None:
        """Refuse what is no layer with InputError."""
        if not (np.isfinite(self.thickness_mm) and self.thickness_mm > 0):
            raise InputError(f"gel thickness {self.thickness_mm} mm: give a length greater than 0")
        if not 0 <= self.poisson_ratio < 0.5:
            raise InputError(f"Poisson's ratio {self.poisson_ratio}: give a number from 0 to below 0.5")


@dataclass(frozen=True, kw_only=True, eq=False)
class Indenting:
    """The pressure on cells that makes a measured depth."""

    pressure: Array
    """(h, w), as a share of Young's modulus"""
    area_mm2: float
    """of a cell"""
    side_px: int
    """of a cell"""
    at_border: bool
    """whether the pressed gel reaches the border of the view"""

    @property
    def integral_mm2(self) -> float:
        """The force for a Young's modulus of 1 N / mm2."""
        return float(self.pressure.sum()) * self.area_mm2


def indenting(depth_mm: NDArray[np.floating], pixel_size_mm: tuple[float, float], layer: Layer) -> Indenting:
    """Find the pressure that presses a layer as deep as a (H, W) depth map says where it exceeds `THRESHOLD_MM`."""
    side = cell_side_px(pixel_size_mm, layer)
    depth = block_means(depth_mm, side).astype(np.float64)
    size_mm = pixel_size_mm[0] * side, pixel_size_mm[1] * side
    pressed = depth > THRESHOLD_MM
    pressure = np.zeros_like(depth)
    if pressed.any():
        part = bounding_box(pressed)
        pressure[part] = _pressure(depth[part], pressed[part], size_mm, layer)
    border = np.concatenate([pressure[[0, -1]].ravel(), pressure[:, [0, -1]].ravel()])
    return Indenting(
        pressure=pressure, area_mm2=size_mm[0] * size_mm[1], side_px=side, at_border=bool((border > 0).any())
    )


def cell_side_px(pixel_size_mm: tuple[float, float], layer: Layer) -> int:
    """Pixels along a side of the cells that pressure is found on."""
    return max(1, round(layer.thickness_mm / CELLS_A_THICKNESS / max(pixel_size_mm)))


def _pressure(depth: Array, pressed: NDArray[np.bool_], size_mm: tuple[float, float], layer: Layer) -> Array:
    """Return p >= 0 in `pressed` that makes `depth` there, for a modulus of 1."""
    shape = tuple(
        scipy.fft.next_fast_len(count + round(MARGIN * layer.thickness_mm / size), real=True)
        for count, size in zip(depth.shape, size_mm[::-1], strict=True)
    )
    response = compliance((shape[0], shape[1]), size_mm, layer)

    def sunk(pressure: Array) -> Array:
        under = scipy.fft.irfft2(scipy.fft.rfft2(pressure, s=shape) * response, s=shape)
        return np.asarray(under[: depth.shape[0], : depth.shape[1]])

    pressure = np.where(pressed, depth, 0.0) / layer.thickness_mm
    along, before, follow = np.zeros_like(depth), 1.0, 0.0
    for _ in range(_MOST_STEPS):
        gap = sunk(pressure) - depth
        active = pressure > 0
        square = float((gap[active] ** 2).sum())
        if square == 0:
            break
        along = np.where(active, gap + follow * square / before * along, 0.0)
        before, change = square, sunk(along)
        step = float((gap * along)[active].sum() / (change * along)[active].sum())
        stepped = np.maximum(pressure - step * along, 0.0)
        joining = (stepped == 0) & (gap < 0) & pressed & ~active
        stepped[joining] = -step * gap[joining]
        follow = 0.0 if joining.any() else 1.0
        moved, pressure = float(np.abs(stepped - pressure).sum()), stepped
        if moved < _SETTLED * pressure.sum():
            break
    return pressure


@lru_cache(maxsize=16)
def compliance(shape: tuple[int, int], size_mm: tuple[float, float], layer: Layer) -> Array:
    """Return G(k) of the module's text on the grid of a real FFT of (h, w) cells, mm for a modulus of 1 N / mm2."""
    along_x = 2 * np.pi * scipy.fft.rfftfreq(shape[1], size_mm[0])[None, :]
    along_y = 2 * np.pi * scipy.fft.fftfreq(shape[0], size_mm[1])[:, None]
    k = np.hypot(along_x, along_y)
    k[0, 0] = 1.0
    q, nu = np.minimum(k * layer.thickness_mm, _HALF_SPACE), layer.poisson_ratio
    kappa = 3 - 4 * nu
    bonded = (kappa * np.sinh(2 * q) - 2 * q) / (kappa * np.cosh(2 * q) + 2 * q**2 + (1 + kappa**2) / 2)
    response = np.asarray(2 * (1 - nu**2) / k * bonded)
    response[0, 0] = layer.thickness_mm * (1 + nu) * (1 - 2 * nu) / (1 - nu)
    response.flags.writeable = False
    return response


@dataclass(frozen=True, kw_only=True)
class ForceScale:
    """What turns an indentation into newtons, and how well."""

    layer: Layer
    youngs_modulus_mpa: float
    error_share: float
    """standard deviation of a force, as a share of it"""
    error_floor_n: float
    """and of no force at all"""
    heaviest_n: float
    """the largest force it was calibrated with"""

    def force(self, depth_mm: NDArray[np.float32], pixel_size_mm: tuple[float, float]) -> Force:
        """Return the force that makes a (H, W) depth map, and its error."""
        found = indenting(depth_mm, pixel_size_mm, self.layer)
        normal_n = self.youngs_modulus_mpa * found.integral_mm2
        reasons = ((BEYOND_VIEW, found.at_border), (HEAVIER, normal_n > HEAVIER_BY * self.heaviest_n))
        flags = tuple(name for name, holds in reasons if holds)
        return Force(
            normal_n=normal_n,
            error_n=float(np.hypot(self.error_floor_n, self.error_share * normal_n)),
            flags=flags,
            pressure_of=lambda: self._pressure_mpa(found, (depth_mm.shape[0], depth_mm.shape[1])),
        )

    def _pressure_mpa(self, found: Indenting, image_shape: tuple[int, int]) -> NDArray[np.float32]:
        """(H, W), each cell's pressure on its pixels."""
        return spread_blocks((self.youngs_modulus_mpa * found.pressure).astype(np.float32), found.side_px, image_shape)
