"""Cosine transforms of rows on the C library, where the length of a row has small prime factors alone; else SciPy's."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from gellight.reconstruction.native.library import Library

Floats = NDArray[np.float32]

RADICES = (4, 5, 3, 2)
_VECTOR = 8
"""numbers in the longest vector"""
_LINE = 16
"""float32 in a line of the cache"""


class CosineRows:
    """Transforms of the rows of maps of one size; keeps working memory, so it serves one thread."""

    def __init__(self, library: Library, shape: tuple[int, int]) -> None:
        """Take the shape of the maps, (rows, numbers in a row)."""
        self._c, (self._rows, self._n) = library, shape
        self._radices = radices_of(self._n // 2) if self._n % 2 == 0 and self._n >= _VECTOR else None
        if self._radices is not None:
            forwards, backwards = _ends(self._n)
            turns = _turns(self._n // 2, self._radices)
            self._forwards, self._backwards = (np.concatenate([ends, turns]) for ends in (forwards, backwards))
            self._work = aligned(3 * self._n * _VECTOR)
            self._passes = np.array([*self._radices, 0], np.int32)

    def forwards(self, maps: Floats) -> Floats:
        """Return the orthonormal transform of type 2 of each row; `maps` is overwritten."""
        if self._radices is None:
            return np.asarray(fft.dct(maps, type=2, norm="ortho", axis=1, overwrite_x=True, workers=1))
        self._c.call("cosines", maps, self._passes, self._forwards, self._work, self._n, self._rows)
        return maps

    def backwards(self, waves: Floats) -> Floats:
        """Return the maps of transforms; `waves` is overwritten."""
        if self._radices is None:
            back = fft.idct(waves, type=2, norm="ortho", axis=1, overwrite_x=True, workers=1)
            return np.ascontiguousarray(back)
        self._c.call("from_cosines", waves, self._passes, self._backwards, self._work, self._n, self._rows)
        return waves


def radices_of(m: int) -> list[int] | None:
    """Return the lengths of the short transforms that make one of m; None where there are none."""
    found = []
    for radix in RADICES:
        while m % radix == 0 and m > 1:
            found.append(radix)
            m //= radix
    return found if m == 1 else None


def _turns(m: int, radices: list[int]) -> Floats:
    """By what each pass turns its results: exp(-2 pi i j p / length) for p, and in it for j from 1 on."""
    turns, stride = [np.zeros(0)], 1
    for radix in radices:
        length = m // stride
        p, j = np.arange(length // radix), np.arange(1, radix)
        turns.append(_pairs(np.exp(-2j * np.pi * np.outer(p, j) / length)))
        stride *= radix
    return np.concatenate(turns).astype(np.float32)


def _ends(n: int) -> tuple[Floats, Floats]:
    """Return a and b of cosine.c, (m + 1, 4) one after the other, forwards and backwards."""
    m, k = n // 2, np.arange(n // 2 + 1)
    turn, half = np.exp(-1j * np.pi * k / (2 * n)), np.exp(-2j * np.pi * k / n)
    size = np.where(k == 0, math.sqrt(1 / (4 * n)), math.sqrt(1 / (2 * n)))
    forwards = size * turn * (1 - 1j * half), size * turn * (1 + 1j * half)
    back = np.conj(turn) / (2 * size)
    backwards = back * (1 + 1j / half) / (2 * m), np.conj(back[::-1]) * (1 - 1j / half) / (2 * m)
    first, second = (_pairs(np.stack(ends, axis=1)).astype(np.float32) for ends in (forwards, backwards))
    return first, second


def _pairs(numbers: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return real and imaginary parts, one after the other."""
    return np.stack([numbers.real, numbers.imag], axis=-1).ravel()


def aligned(*shape: int) -> Floats:
    """Return zeros that begin where a line of the cache does: vectors that lie across two take twice as long."""
    size = math.prod(shape)
    memory = np.full(size + _LINE, 0, np.float32)
    begin = -memory.ctypes.data % (4 * _LINE) // 4
    return memory[begin : begin + size].reshape(shape)
