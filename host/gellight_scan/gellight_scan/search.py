"""Where one press may lie on another, when nobody knows: the slopes of the two, correlated at every shift and turn.

Only gel that reached the part takes part, so the correlation is over the overlap of two masks, by FFT (Padfield, IEEE
Trans. Image Process. 21, 2012). Slopes are complex numbers, dx + i dy, which a turn multiplies by a phase.
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import affine_transform, maximum_filter

from gellight.frames.pixel_grid import block_means
from gellight_scan.tracking.view import View

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
COARSER = 2
"""by so much smaller than registration works at"""
TURNS_RAD = np.radians(np.arange(-15.0, 15.1, 2.5))
"""that a hand may turn the sensor by between presses"""
LEAST_MM2 = 5.0
"""of gel that reached the part in both presses"""
APART_PX = 4
"""between starts"""


@dataclass(frozen=True, eq=False)
class Slopes:
    """The slopes of a press on a coarse grid, complex, 0 where the gel did not reach the part."""

    values: Complex
    reached: Array
    pixel_mm: tuple[float, float]
    middle_px: tuple[float, float]

    @classmethod
    def of(cls, view: View) -> "Slopes":
        """Take the slopes of a view, less their mean: two presses are tilted differently."""
        reached = view.touching.astype(np.float64)
        slopes = view.planes[..., 1] + 1j * view.planes[..., 2]
        slopes = np.where(view.touching, slopes - slopes[view.touching].mean(), 0)
        real, imaginary, share = (block_means(plane, COARSER) for plane in (slopes.real, slopes.imag, reached))
        pixel = view.pixel_mm[0] * COARSER, view.pixel_mm[1] * COARSER
        middle = [(middle - (COARSER - 1) / 2) / COARSER for middle in view.middle_px]
        return cls(real + 1j * imaginary, share, pixel, (middle[0], middle[1]))

    def turned(self, angle_rad: float) -> "Slopes":
        """Return what a sensor sees that is turned by an angle about its middle, x towards y."""
        rotation = _pixel_rotation(angle_rad, self.pixel_mm)
        middle = np.array(self.middle_px[::-1])
        planes = [
            affine_transform(plane, rotation, middle - rotation @ middle, order=1)
            for plane in (self.values.real, self.values.imag, self.reached)
        ]
        return Slopes((planes[0] + 1j * planes[1]) * np.exp(-1j * angle_rad), planes[2], self.pixel_mm, self.middle_px)


def _pixel_rotation(angle_rad: float, pixel_mm: tuple[float, float]) -> Array:
    """Return the (2, 2) that takes rows and columns of the turned grid to those of the grid itself."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    size = np.array(pixel_mm[::-1])
    return np.asarray(np.array([[c, s], [-s, c]]) * size[None, :] / size[:, None])


def starts(one: View, other: View, most: int) -> list[Array]:
    """Return up to `most` poses that may carry `one` to `other`, the likeliest first."""
    here, there = Slopes.of(one), Slopes.of(other)
    shape = tuple(scipy.fft.next_fast_len(a + b) for a, b in zip(here.values.shape, there.values.shape, strict=True))
    spectra = _spectra(here, shape)
    found: list[tuple[float, Array]] = []
    for angle in TURNS_RAD:
        likely = _likelihood(spectra, _spectra(there.turned(float(angle)), shape), here.pixel_mm)
        found += [(score, _pose(shift, float(angle), here)) for score, shift in _peaks(likely, most)]
    found.sort(key=lambda each: -each[0])
    return [pose for _, pose in found[:most]]


def _spectra(slopes: Slopes, shape: tuple[int, ...]) -> tuple[Complex, Complex, Complex]:
    """Return the transforms of slopes, of what was reached, and of the squares of the slopes."""
    planes = (slopes.values, slopes.reached, np.abs(slopes.values) ** 2)
    one, two, three = (scipy.fft.fft2(plane, s=shape) for plane in planes)
    return one, two, three


def _likelihood(
    one: tuple[Complex, Complex, Complex], other: tuple[Complex, Complex, Complex], pixel_mm: tuple[float, float]
) -> Array:
    """Return for each shift the correlation times the root of the area that it is over: chance makes all alike."""

    def correlated(a: Complex, b: Complex) -> Array:
        return np.asarray(scipy.fft.ifft2(np.conj(a) * b).real)

    common = correlated(one[0], other[0])
    energy = correlated(one[2], other[1]).clip(min=0) * correlated(one[1], other[2]).clip(min=0)
    area = correlated(one[1], other[1]) * pixel_mm[0] * pixel_mm[1]
    enough = area > LEAST_MM2
    likely = common / np.sqrt(np.maximum(energy, 1e-12)) * np.sqrt(np.maximum(area, 0))
    return np.where(enough, likely, 0.0)


def _peaks(likely: Array, most: int) -> list[tuple[float, tuple[int, int]]]:
    """Return the highest peaks and their shifts in rows and columns."""
    top = (likely == maximum_filter(likely, 2 * APART_PX + 1, mode="wrap")) & (likely > 0)
    rows, columns = np.nonzero(top)
    best = np.argsort(-likely[rows, columns])[:most]
    height, width = likely.shape
    return [
        (
            float(likely[rows[i], columns[i]]),
            (int((rows[i] + height // 2) % height - height // 2), int((columns[i] + width // 2) % width - width // 2)),
        )
        for i in best
    ]


def _pose(shift: tuple[int, int], angle_rad: float, slopes: Slopes) -> Array:
    """Return the pose (4, 4) of a shift on the grid and the turn before it."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    pose = np.eye(4)
    pose[:2, :2] = [[c, -s], [s, c]]
    pose[:2, 3] = pose[:2, :2] @ [shift[1] * slopes.pixel_mm[0], shift[0] * slopes.pixel_mm[1]]
    return pose
