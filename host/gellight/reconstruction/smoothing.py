"""Noise taken out of a gradient map, as widely as the surface itself allows.

A Savitzky-Golay filter (1964) puts a quadratic through the pixels around and keeps every slope that varies like one
across it. The wider the filter the less noise is left, and the wider a contact must be to be kept. So it is done twice:

* `Smoother.prefilter` smooths the slopes as measured by the narrowest filter, before they are integrated, so that no
  contact loses height. What it takes away is nearly all noise: its strength, place by place, is measured from that.
* `Smoother.smooth_adaptively` smooths the slopes of the integrated surface further, pixel by pixel as far as they
  allow, by Lepski's principle (Goldenshluger and Nemirovski 1997; Katkovnik 1999): the next wider filter is taken as
  far as its answer differs from the narrower one's by no more than that noise explains. At a rim it differs by far
  more, and nothing is changed there.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import between_blocks, bounding_box
from gellight.reconstruction.integration import surface_gradient

Floats = NDArray[np.float32]

NARROWEST_PX = 2
"""Default half width of the narrowest filter: it leaves half of the noise (x 0.49), and a Gaussian contact of sigma
3 px keeps 99.4 % of its height. 3 would leave a third of the noise and 97.5 % of that height."""
LADDER = (1.5, 2.5, 4.5)
"""half widths of the wider filters, as multiples of the narrowest"""
_CELL = 4
"""noise and choice are looked at in means over cells of this many pixels a side"""
_NOISE_CELLS = 9
"""cells a side over which the strength of the noise is averaged"""
_PERIOD = 128
"""waves of all frequencies that fit into this many pixels stand for white noise"""
_AGREE, _DIFFER = 1.5, 3.0
"""energy of the difference between two filters, as a multiple of what noise makes: up to the first the wider filter is
taken whole, from the second on not at all"""


def half_widths(narrowest: int) -> tuple[int, ...]:
    """Return the half widths of the wider filters, px, for that of the narrowest."""
    return tuple(round(narrowest * step) for step in LADDER)


def weights(half_width: int) -> NDArray[np.float64]:
    """(2 w + 1,) value at the middle of the parabola fitted through 2 w + 1 samples (Savitzky and Golay 1964)."""
    n, j = half_width, np.arange(-half_width, half_width + 1)
    return np.asarray(3 * (3 * n * n + 3 * n - 1 - 5 * j * j) / ((2 * n + 3) * (2 * n + 1) * (2 * n - 1)))


def fixed(slopes: Floats, half_width: int, out: Floats | None = None) -> Floats:
    """Smooth (H, W, 2) slopes along both axes by one filter; beyond the border the last value continues."""
    if half_width < 2:  # a parabola through three samples passes through them
        return slopes
    taps = weights(half_width)
    return np.asarray(cv2.sepFilter2D(slopes, -1, taps, taps, out, borderType=cv2.BORDER_REPLICATE))


@dataclass(frozen=True, eq=False)
class FilterTaps:
    """The weights of the filters of one narrowest half width, at least 2, as the native path takes them."""

    narrowest: NDArray[np.float32]
    """weights from the middle outwards"""
    wider: NDArray[np.float32]
    """the same of the three wider filters, one after the other"""
    reach: NDArray[np.int32]
    """half widths of all four, px; then half widths of the energies' means, cells"""
    energies: NDArray[np.float32]
    """what white noise of variance 1 makes of the difference to the next narrower one"""

    @classmethod
    def of(cls, narrowest: int) -> Self:
        """Return those of a narrowest half width, px."""
        widths, first = half_widths(narrowest), weights(narrowest)[narrowest:]
        reach = [narrowest, *widths, *(_cells(width) // 2 for width in (narrowest, *widths))]
        return cls(
            narrowest=first.astype(np.float32),
            wider=np.concatenate([weights(width)[width:] for width in widths]).astype(np.float32),
            reach=np.array(reach, np.int32),
            energies=np.array([_left_out(narrowest), *_energies(narrowest)], np.float32),
        )


class Smoother:
    """The smoothing of the maps of one sensor; one smoother serves one thread.

    It keeps its working memory: to get fresh arrays of this size from the system takes longer than all the filters.
    """

    def __init__(self, narrowest: int = NARROWEST_PX) -> None:
        """Take the half width of the narrowest filter, px; below 2 nothing is smoothed."""
        self.narrowest = narrowest
        self._memory: list[Floats] = []

    def prefilter(self, slopes: Floats) -> tuple[Floats, Floats]:
        """Smooth (H, W, 2) measured slopes by the narrowest filter; return them, and the variance of their noise.

        The variance is that of one pixel before the smoothing, (ceil(H / 4), ceil(W / 4), 2), were the noise white.
        """
        smoothed = fixed(slopes, self.narrowest)
        taken = self._arrays(slopes.shape, 1)[0]
        cv2.subtract(slopes, smoothed, taken)
        # What the filter leaves of white noise and what it takes add up to all of it.
        left = _left(self.narrowest) if self.narrowest > 1 else 0.0
        return smoothed, _cell_energy(taken, _NOISE_CELLS, taken) / np.float32(1 - left)

    def of_surface(
        self,
        depth_mm: NDArray[np.floating],
        pixel_size_mm: float | tuple[float, float],
        measured: Floats,
        noise: Floats,
        *,
        where: NDArray[np.bool_] | None = None,
    ) -> Floats:
        """Return the (H, W, 2) slopes of the (H, W) depth map integrated from `measured`, smoothed adaptively.

        They have no curl, slopes measured in noise do: what fits no surface is left out.
        """
        gradient_map = surface_gradient(depth_mm, pixel_size_mm)
        self.smooth_adaptively(gradient_map, measured, noise, where=where)
        return gradient_map

    def smooth_adaptively(
        self, surface: Floats, measured: Floats, noise: Floats, *, where: NDArray[np.bool_] | None = None
    ) -> None:
        """Smooth (H, W, 2) slopes of a surface further, in place, each pixel as widely as the surface allows.

        measured, noise: what `prefilter` returned. surface: what `surface_gradient` makes of the measured slopes after
        their integration. Where the two differ by more than the noise explains, the measured ones are
        taken: slopes that are wrong somewhere, as where nothing was learnt, would spoil the surface around.

        Slopes that vary like a quadratic stay as they are, but for the border, where the last value continues. Of white
        noise in the slopes measured there remains, with 2 for the narrowest half width, a share of 0.09 where the
        surface is smooth over 19 pixels, and of 0.33 at a rim. where: (H, W) nothing is done outside the rectangle
        around these pixels, which saves time.
        """
        if self.narrowest < 2 or (where is not None and not where.any()):
            return
        around = (slice(0, size) for size in surface.shape[:2]) if where is None else bounding_box(where)
        rows, columns = box = tuple(slice(side.start // _CELL * _CELL, side.stop) for side in around)
        noise = noise[rows.start // _CELL : -(-rows.stop // _CELL), columns.start // _CELL : -(-columns.stop // _CELL)]
        noise = noise + np.finfo(np.float32).tiny
        self._add_wider(surface[box], noise * self._reconcile(surface[box], measured[box], noise))

    def _reconcile(self, surface: Floats, measured: Floats, noise: Floats) -> Floats:
        """Replace slopes of the surface by the measured ones where they differ by more than noise explains.

        Returns the energy of the noise in the result, (h, w, 1), in units of that in the surface: 1 to 2.
        """
        change, work = self._arrays(surface.shape, 2)
        cv2.subtract(surface, measured, change)
        energy = _cell_energy(change, _cells(self.narrowest), work) / noise
        share = _noise_weight(energy, _left_out(self.narrowest))
        _spread(share, work)
        cv2.add(measured, cv2.multiply(change, work, change), surface)
        return np.asarray(1 + (1 - share[..., None]) ** 2)

    def _add_wider(self, slopes: Floats, noise: Floats) -> None:
        """Smooth a whole map, whose noise is nowhere 0."""
        before, last, wider, change, work = self._arrays(slopes.shape, 5)
        for copy in (before, last):
            np.copyto(copy, slopes)
        share = np.ones(noise.shape[:2], np.float32)
        for width, energy in zip(half_widths(self.narrowest), _energies(self.narrowest), strict=True):
            fixed(before, width, wider)
            cv2.subtract(wider, last, change)
            share *= _noise_weight(_cell_energy(change, _cells(width), work) / noise, energy)
            _spread(share, work)
            slopes += cv2.multiply(change, work, change)
            last, wider = wider, last

    def _arrays(self, shape: tuple[int, ...], count: int) -> list[Floats]:
        """Arrays of this shape with anything in them, until the next call."""
        size = int(np.prod(shape))
        if len(self._memory) < count or self._memory[0].size < size:
            self._memory = [np.empty(size, np.float32) for _ in range(count)]
        return [memory[:size].reshape(shape) for memory in self._memory[:count]]


def _noise_weight(seen: Floats, energy: float) -> Floats:
    """(h, w) share to which noise of this energy explains the difference `seen` (h, w, 2): 1 wholly, 0 not at all."""
    worst = np.maximum(seen[..., 0], seen[..., 1]) / np.float32(energy)
    return np.clip((_DIFFER - worst) / np.float32(_DIFFER - _AGREE), 0, 1)


def _left(narrowest: int) -> float:
    """Variance that the narrowest filter leaves of white noise of variance 1."""
    return float(weights(narrowest)[narrowest] ** 2)


def _left_out(narrowest: int) -> float:
    """Variance of the half of it that has a curl: what the surface leaves out."""
    return _left(narrowest) / 2


@cache
def _energies(narrowest: int) -> tuple[float, ...]:
    """Variance of the difference between each filter and the next narrower one, for white noise of variance 1.

    Before the filters the noise passes the narrowest filter and the integration. The integration leaves half of its
    energy: the part without curl. Differentiating damps the shortest waves too, which makes 0.7 of the first number;
    that is left out, because with it normals are up to 4 % worse (`python -m tests.benchmarks.selfcheck`).
    """
    frequencies = np.fft.fftfreq(_PERIOD)
    answers = [_answer(width, frequencies) for width in half_widths(narrowest)]
    first = _answer(narrowest, frequencies)
    before = [np.ones_like(first), *answers]
    return tuple(float(((first * (wide - last)) ** 2).mean() / 2) for last, wide in zip(before, answers, strict=False))


def _answer(half_width: int, frequencies: NDArray[np.floating]) -> NDArray[np.float64]:
    """(n, n) answer of a filter to waves of these frequencies, 1 / px, along both axes."""
    at = np.arange(-half_width, half_width + 1)
    along = np.cos(2 * np.pi * np.outer(frequencies, at)) @ weights(half_width)
    return np.outer(along, along)


def _cells(half_width: int) -> int:
    """Cells a side over which the answers of a filter are compared: about its width, and at least three."""
    return max(3, round((2 * half_width + 1) / _CELL) | 1)


def _spread(share: Floats, work: Floats) -> None:
    """Put (h, w) shares, linear between the middles of their cells, into both planes of an (H, W, 2) array."""
    work[:] = between_blocks(share, _CELL, work.shape)[..., None]


def _cell_energy(values: NDArray[Any], cells: int, work: NDArray[Any]) -> Floats:
    """(h, w, 2) mean square of (H, W, 2) values in cells, over `cells` cells a side; `work` is overwritten.

    A cell that the border cuts is of the pixels that are there.
    """
    squares, (height, width) = cv2.multiply(values, values, work), values.shape[:2]
    beyond_y, beyond_x = -height % _CELL, -width % _CELL
    if beyond_y or beyond_x:
        squares = cv2.copyMakeBorder(squares, 0, beyond_y, 0, beyond_x, cv2.BORDER_CONSTANT, value=(0, 0))
    size = (squares.shape[1] // _CELL, squares.shape[0] // _CELL)
    energy = cv2.resize(squares, size, interpolation=cv2.INTER_AREA)
    energy[-1] *= _CELL / (_CELL - beyond_y)
    energy[:, -1] *= _CELL / (_CELL - beyond_x)
    return np.asarray(cv2.blur(energy, (cells, cells), borderType=cv2.BORDER_REFLECT))
