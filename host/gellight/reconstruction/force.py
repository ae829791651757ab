"""Depth map to force: the gel as an elastic layer, which one modulus makes stiff or soft.

Under a normal pressure p a layer of thickness h, bonded to its support, has the depth u whose Fourier transform is

    u(k) = G(k) p(k)
    G(k) = 2 (1 - nu^2) / (E k) * (kappa sinh 2q - 2q) / (kappa cosh 2q + 2q^2 + (1 + kappa^2) / 2)

with q = k h, kappa = 3 - 4 nu, and G(0) = h (1 + nu) (1 - 2 nu) / (E (1 - nu)) (Johnson, Contact Mechanics, 1985,
section 5.8). The depth is measured, so p is found backwards: where the gel is pressed, p is at least 0 and makes the
measured depth; elsewhere p is 0. That p makes p G p / 2 - u p least. The gradient method of Polonsky and Keer (Wear
231, 1999) finds it in about ten steps, on cells of a tenth of the thickness. The force is the integral of p.

Slopes tell a depth but for its zero, and a gel that hardly gives way as a whole turns an error of the zero into a large
force. The layer knows the zero: beside the contact the depth is what the pressure in it makes. So a plane is sought in
turn with p that takes the depth there onto G p; each round goes on from the pressure of the one before.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.pixel_grid import block_means, bounding_box, grown, over_gel
from gellight.reconstruction.contact import THRESHOLD_MM, find_contact

Array = NDArray[np.float64]

SILICONE = 0.49
"""Poisson's ratio of silicones, which hardly change their volume"""
CELLS_A_THICKNESS = 10  # measured: balls of finite elements then agree in force within 0.5 %
REACH = 6.0
"""thicknesses: what is further away is not felt. With 3, forces are 2 % too large"""
BORDER_SHARE = 0.05
"""of the pressure on the outermost cells of the view: the load goes on beyond it"""
_PATCH_CELLS = 2
"""around the contact patch that may carry pressure"""
_ROUNDS = 4  # measured: 25 finite-element presses are within 0.3 % of the force of any number
_PATCH_ROUNDS = 2
"""that look where the contact is: from then on its place is known, and its border is where the pressure ends"""
_ZERO_SETTLED_MM = 2e-4  # chosen: far below the 0.03 mm that can make a force several times wrong
_PLANE_SETTLED_MM = 2e-5  # chosen: a tenth of it
_LEAST_FREE = 0.05
"""of the view beside the contact: from less no zero is found"""
_ZERO_CELLS = 1000
"""for three numbers: four times as many move the force of no press by 0.1 %"""
_OUTLIER = 1.5
"""medians of what the plane leaves: beyond that a cell weighs less"""
_MOST_STEPS = 100  # chosen: ends a search that does not settle
_SETTLED = 1e-2
"""change of the pressure in one step, as a share of all of it, until the zero has settled"""
_SETTLED_AT_LAST = 1e-3
"""forces of the finite-element presses are within 0.3 % of those that 1e-6 and any number of rounds give"""
_HALF_SPACE = 30.0
"""from this q on a layer is a half space to 1e-13, and sinh would overflow"""


@dataclass(frozen=True)
class Layer:
    """A soft layer on a rigid support."""

    thickness_mm: float
    poisson_ratio: float = SILICONE

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
    """whether `BORDER_SHARE` of the pressure is at the border of the view: nobody knows what there is beyond it"""

    @property
    def integral_mm2(self) -> float:
        """The force for a Young's modulus of 1 N / mm2."""
        return float(self.pressure.sum()) * self.area_mm2


def indenting(
    depth_mm: NDArray[np.floating], pixel_size_mm: tuple[float, float], layer: Layer, camera_height_mm: float = 0.0
) -> Indenting:
    """Find the pressure that presses a layer as deep as a (H, W) depth map says, whose zero may be any plane.

    There is pressure in the contact patch and close around it alone, where the depth exceeds `THRESHOLD_MM`.
    camera_height_mm: from which the map is seen, as `over_gel` has it; the pressure lies over the gel at rest.
    """
    side = cell_side_px(pixel_size_mm, layer)
    depth = over_gel(block_means(depth_mm.astype(np.float32, copy=False), side), camera_height_mm).astype(np.float64)
    size_mm = pixel_size_mm[0] * side, pixel_size_mm[1] * side
    pressure = _pressure_and_zero(depth, size_mm, layer)
    inside = float(pressure[1:-1, 1:-1].sum())
    cut_off = float(pressure.sum()) - inside
    return Indenting(
        pressure=pressure,
        area_mm2=size_mm[0] * size_mm[1],
        side_px=side,
        at_border=cut_off > BORDER_SHARE * (cut_off + inside),
    )


def _pressure_and_zero(depth: Array, size_mm: tuple[float, float], layer: Layer) -> Array:
    """Return the pressure that makes the depth in the contact patch of these cells, but for a plane."""
    pressure, zero = np.zeros_like(depth), np.zeros_like(depth)
    for rounds in range(1, _ROUNDS + 1):
        if rounds <= _PATCH_ROUNDS:
            patch = grown(find_contact(depth - zero, size_mm).mask, _PATCH_CELLS, corners=False)
        last = rounds == _ROUNDS
        pressure = _pressed(depth - zero, patch, pressure, size_mm, layer, _SETTLED_AT_LAST if last else _SETTLED)
        if last or not pressure.any():
            break
        found = _zero(depth, pressure, size_mm, layer)
        if rounds > 1 and np.abs(found - zero).max() < _ZERO_SETTLED_MM:
            break
        zero = found
    return pressure


def _pressed(
    depth: Array, patch: NDArray[np.bool_], before: Array, size_mm: tuple[float, float], layer: Layer, settled: float
) -> Array:
    """Return the pressure that makes the depth in a patch of cells; before: a pressure that is near, or none."""
    pressed = patch & (depth > THRESHOLD_MM)
    pressure = np.zeros_like(depth)
    if pressed.any():
        part = bounding_box(pressed)
        pressure[part] = _pressure(depth[part], pressed[part], before[part], size_mm, layer, settled)
    return pressure


def _zero(depth: Array, pressure: Array, size_mm: tuple[float, float], layer: Layer) -> Array:
    """Return the plane that the depth has beyond what the pressure makes, on cells without pressure; robust."""
    free = pressure == 0
    if free.mean() < _LEAST_FREE:
        return np.zeros_like(depth)
    every = max(1, math.isqrt(np.count_nonzero(free) // _ZERO_CELLS))
    some = np.zeros_like(free)
    some[every // 2 :: every, every // 2 :: every] = free[every // 2 :: every, every // 2 :: every]
    left = (depth - _sunk(pressure, size_mm, layer))[some]
    everywhere = _plane_terms(depth.shape)
    terms = weighted = everywhere[:, some.ravel()]
    plane = np.zeros(3)
    for _ in range(5):
        before, plane = plane, np.asarray(np.linalg.lstsq(weighted @ terms.T, weighted @ left, rcond=None)[0])
        if np.abs(plane - before).max() < _PLANE_SETTLED_MM:
            break
        off = np.abs(left - plane @ terms)
        weighted = terms / np.maximum(1, off / (_OUTLIER * np.median(off) + 1e-9)) ** 2
    return np.asarray((plane @ everywhere).reshape(depth.shape))


@lru_cache(maxsize=4)
def _plane_terms(shape: tuple[int, int]) -> Array:
    """(3, h w): 1, and the row and the column of each cell, as a share of the view."""
    return np.stack([np.ones(shape), *np.indices(shape) / np.array(shape)[:, None, None]]).reshape(3, -1)


def _sunk(pressure: Array, size_mm: tuple[float, float], layer: Layer) -> Array:
    """Return the depth that a pressure makes in the cells of the view."""
    shape = _padded(pressure.shape, size_mm, layer)
    rows, columns = pressure.shape
    padded = np.zeros(shape)
    padded[:rows, :columns] = pressure
    under = cv2.mulSpectrums(cv2.dft(padded, nonzeroRows=rows), _influence(shape, size_mm, layer), 0)
    return np.asarray(cv2.idft(under, flags=cv2.DFT_SCALE, nonzeroRows=rows)[:rows, :columns])


def _padded(cells: tuple[int, ...], size_mm: tuple[float, float], layer: Layer) -> tuple[int, int]:
    """Return the shape of the transform that holds the distance of any two cells once, as far as one is felt."""
    rows, columns = (
        cv2.getOptimalDFTSize(count + min(count - 1, _reach(size, layer)))
        for count, size in zip(cells, size_mm[::-1], strict=True)
    )
    return rows, columns


def _reach(size_mm: float, layer: Layer) -> int:
    """Cells to where nothing is felt any more."""
    return round(REACH * layer.thickness_mm / size_mm)


def cell_side_px(pixel_size_mm: tuple[float, float], layer: Layer) -> int:
    """Pixels along a side of the cells that pressure is found on."""
    return max(1, round(layer.thickness_mm / CELLS_A_THICKNESS / max(pixel_size_mm)))


def _pressure(
    depth: Array,
    pressed: NDArray[np.bool_],
    before: Array,
    size_mm: tuple[float, float],
    layer: Layer,
    settled: float,
) -> Array:
    """Return p >= 0 in `pressed` that makes `depth` there, for a modulus of 1; before: where to begin, unless 0."""
    pressure = np.where(pressed, before if before.any() else depth / layer.thickness_mm, 0.0)
    along, last_square, follow = np.zeros_like(depth), 1.0, 0.0
    gap = _sunk(pressure, size_mm, layer) - depth
    for _ in range(_MOST_STEPS):
        active = pressure > 0
        downhill = np.where(active, gap, 0.0)
        square = float(np.vdot(downhill, downhill))
        if square == 0:
            break
        along = np.where(active, gap + follow * square / last_square * along, 0.0)
        last_square, change = square, _sunk(along, size_mm, layer)
        step = float(np.vdot(downhill, along) / np.vdot(along, change))
        linear = pressure - step * along
        stepped = np.maximum(linear, 0.0)
        joining = (stepped == 0) & (gap < 0) & pressed & ~active
        stepped[joining] = -step * gap[joining]
        follow = 0.0 if joining.any() else 1.0
        moved, pressure = float(np.abs(stepped - pressure).sum()), stepped
        whole = follow and np.array_equal(stepped, linear)
        gap = gap - step * change if whole else _sunk(pressure, size_mm, layer) - depth
        if moved < settled * pressure.sum():
            break
    return pressure


@lru_cache(maxsize=64)
def _influence(shape: tuple[int, int], size_mm: tuple[float, float], layer: Layer) -> Array:
    """Return how deep a cell of pressure sinks those of a (h, w) window of a gel without end, transformed.

    As OpenCV packs it.
    """
    rows, columns = (
        cv2.getOptimalDFTSize(count // 2 + _reach(size, layer) + 1)
        for count, size in zip(shape, size_mm[::-1], strict=True)
    )
    rows, columns = max(rows, shape[0]), max(columns, shape[1])
    deep = np.fft.irfft2(compliance((rows, columns), size_mm, layer), s=(rows, columns))
    down, along = (np.rint(np.fft.fftfreq(count, 1 / count)).astype(np.intp) for count in shape)
    influence = np.asarray(cv2.dft(deep[down[:, None], along]))
    influence.flags.writeable = False
    return influence


def compliance(shape: tuple[int, int], size_mm: tuple[float, float], layer: Layer) -> Array:
    """Return G(k) of the module's text on the grid of a real FFT of (h, w) cells, mm for a modulus of 1 N / mm2."""
    along_x = 2 * np.pi * np.fft.rfftfreq(shape[1], size_mm[0])[None, :]
    along_y = 2 * np.pi * np.fft.fftfreq(shape[0], size_mm[1])[:, None]
    k = np.hypot(along_x, along_y)
    k[0, 0] = 1.0
    nu = layer.poisson_ratio
    response = np.asarray(2 * (1 - nu**2) / k * bonded(k * layer.thickness_mm, nu))
    response[0, 0] = layer.thickness_mm * (1 + nu) * (1 - 2 * nu) / (1 - nu)
    response.flags.writeable = False
    return response


def bonded(q: Array, poisson_ratio: float) -> Array:
    """Return the compliance of a bonded layer over that of a half space, for q = k h."""
    q, kappa = np.minimum(q, _HALF_SPACE), 3 - 4 * poisson_ratio
    return np.asarray((kappa * np.sinh(2 * q) - 2 * q) / (kappa * np.cosh(2 * q) + 2 * q**2 + (1 + kappa**2) / 2))
