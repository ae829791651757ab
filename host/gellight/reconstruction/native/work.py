"""The working memory of the native path, taken once: a frame allocates nothing but what it returns."""

import ctypes
import math
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.contact import FEWEST_BLOCKS, LEVELS, SMALLEST_PATCH_PX
from gellight.reconstruction.gelnet import BLOCK_ROWS, CELL_PX, COARSE_PX
from gellight.reconstruction.smoothing import FilterTaps

Floats = NDArray[np.float32]
_LINE = 16
"""float32 in a line of the cache"""


class WorkMemory:
    """Arrays for images of one size; w, h are numbers of cells. frame_path.h has the terms."""

    def __init__(self, image_shape: tuple[int, int], taps: FilterTaps | None, kept_rows: int) -> None:
        """Take it all, and write to each page, so that the first frame is as fast as the others.

        kept_rows: as the library says.
        """
        height, width = image_shape
        h, w = (-(-n // CELL_PX) for n in image_shape)
        coarse_h, coarse_w = (-(-n // COARSE_PX) for n in image_shape)
        widest = int(taps.reach[3]) if taps else 0
        self.shift = aligned(width, 3)
        self.means = aligned(3, 2 * coarse_h, 2 * coarse_w)
        self.touched, self.near, self.high_contrast, self.low_contrast = np.zeros((4, h, w), np.uint8)
        self.around = np.zeros((coarse_h, coarse_w), np.uint8)
        self.bytes = np.zeros(2 * h * w + width + 4, np.uint8)
        self.cell_rows = aligned(h * w, 5)
        self.coarse_rows, self.coarse = aligned(coarse_h * coarse_w, 5), aligned(coarse_h * coarse_w, 2)
        self.index = np.zeros(height * width, np.int32)
        self.rows = aligned(max(h * w, BLOCK_ROWS), 5)
        self.planes, self.coarse_planes = aligned(11, h, w), aligned(11, coarse_h, coarse_w)
        self.doubts = aligned(2, h, w)
        self.slopes, self.measured, self.surface = (aligned(2, height, width) for _ in range(3))
        self.noise, self.energy = aligned(2, h, w), aligned(h, w)
        self.factors, self.column = elimination(image_shape), np.zeros(height)
        self.small = aligned(14, h, w)
        self.flags = np.zeros(4 * h * w + 2 * w + 2 * widest, np.uint8)
        self.changes = aligned(2 * kept_rows, width)
        self.work, self.work_plane = aligned(16 * (width + 64) + 2 * widest), aligned(height * width)
        blocks = -(-height // 2) * -(-width // 2)
        self.blocks, self.deepest = aligned(blocks), aligned(blocks + 1)
        self.label, self.parent, self.slot = np.zeros(blocks, np.int32), *np.zeros((2, blocks + 1), np.int32)
        self.histogram = aligned(blocks // FEWEST_BLOCKS + 1, 2 * LEVELS)
        self.found = np.zeros(4)
        self.runs = np.zeros(4 * height * -(-width // 2), np.int32)
        self.parts = np.zeros((height * width // SMALLEST_PATCH_PX + 1, 6))


def elimination(image_shape: tuple[int, int]) -> Floats:
    """(H, W) one over each pivot of `solve_columns`, worked out in double precision."""
    height, width = image_shape
    wave = 2 - 2 * np.cos(np.pi * np.arange(width) / width)
    factors = np.zeros((height, width))
    factors[0] = -1 / (1 + wave)
    with np.errstate(divide="ignore", invalid="ignore"):  # of column 0, which is summed instead
        for y in range(1, height):
            factors[y] = -1 / (wave + (2 if y < height - 1 else 1) + factors[y - 1])
    factors[:, 0] = 0
    return factors.astype(np.float32)


MOST_FREE = 3
"""of each kind; a reader that kept many frames gives their memory back to the system"""


class ArrayPool:
    """The arrays of one kind. Whoever has one, or a view of it, owns it: nothing is written into it any more."""

    def __init__(self, shape: tuple[int, ...], kind: type[np.generic] = np.float32) -> None:
        """Take the shape and the type of all of them."""
        self._shape, self._kind = shape, np.dtype(kind)
        self._floats = -(-int(np.prod(shape)) * self._kind.itemsize // 4)
        self._carrier = ctypes.c_byte * (int(np.prod(shape)) * self._kind.itemsize)
        self._free: list[NDArray[np.float32]] = []

    def take(self) -> NDArray[Any]:
        """Return an array with anything in it."""
        try:
            memory = self._free.pop()
        except IndexError:
            memory = aligned(self._floats)
        # The array and all its views keep the carrier, and nothing else does.
        carrier = self._carrier.from_address(memory.ctypes.data)
        weakref.finalize(carrier, self._take_back, memory).atexit = False
        return np.frombuffer(memoryview(carrier), self._kind).reshape(self._shape)

    def _take_back(self, memory: NDArray[np.float32]) -> None:
        if len(self._free) < MOST_FREE:
            self._free.append(memory)


def aligned(*shape: int) -> Floats:
    """Return zeros that begin where a line of the cache does: vectors that lie across two take twice as long."""
    size = math.prod(shape)
    memory = np.full(size + _LINE, 0, np.float32)
    begin = -memory.ctypes.data % (4 * _LINE) // 4
    return memory[begin : begin + size].reshape(shape)
