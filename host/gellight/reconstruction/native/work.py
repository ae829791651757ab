"""The working memory of the native path, taken once: a frame allocates nothing but what it returns."""

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.contact import FEWEST_BLOCKS, LEVELS, SMALLEST_PATCH_PX
from gellight.reconstruction.gelnet import CELL_PX, COARSE_PX
from gellight.reconstruction.smoothing import FilterTaps

Floats = NDArray[np.float32]


class WorkMemory:
    """Arrays for images of one size; w, h are numbers of cells. frame_path.h has the terms."""

    def __init__(self, image_shape: tuple[int, int], taps: FilterTaps | None) -> None:
        """Take it all, and write to each page, so that the first frame is as fast as the others."""
        height, width = image_shape
        h, w = (-(-n // CELL_PX) for n in image_shape)
        coarse_h, coarse_w = (-(-n // COARSE_PX) for n in image_shape)
        widest, reach_cells = (int(taps.reach[k]) for k in (3, 7)) if taps else (0, 0)
        self.shift = _floats(width, 3)
        self.means = _floats(3, 2 * coarse_h, 2 * coarse_w)
        self.touched, self.near, self.high_contrast, self.low_contrast = np.zeros((4, h, w), np.uint8)
        self.around = np.zeros((coarse_h, coarse_w), np.uint8)
        self.bytes = np.zeros(2 * h * w + width + 4, np.uint8)
        self.cell_rows = _floats(h * w, 5)
        self.coarse_rows, self.coarse = _floats(coarse_h * coarse_w, 5), _floats(coarse_h * coarse_w, 2)
        self.index = np.zeros(height * width, np.int32)
        self.rows = _floats(max(h * w, 4096), 5)
        self.planes, self.coarse_planes = _floats(11, h, w), _floats(11, coarse_h, coarse_w)
        self.doubts = _floats(2, h, w)
        self.slopes, self.measured, self.surface = (_floats(2, height, width) for _ in range(3))
        self.noise, self.energy = _floats(2, h, w), _floats(h, w)
        self.factors, self.column = elimination(image_shape), np.zeros(height)
        self.small = _floats(14, h, w)
        self.kept_rows = CELL_PX * (max(-(-widest // CELL_PX), reach_cells + 1) + 1)
        self.changes = _floats(6, self.kept_rows, width)
        self.work, self.work_plane = _floats(16 * (width + 64) + 2 * widest), _floats(height * width)
        blocks = -(-height // 2) * -(-width // 2)
        self.blocks, self.deepest = _floats(blocks), _floats(blocks + 1)
        self.label, self.parent, self.slot = np.zeros(blocks, np.int32), *np.zeros((2, blocks + 1), np.int32)
        self.histogram = _floats(blocks // FEWEST_BLOCKS + 1, 2 * LEVELS)
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


def _floats(*shape: int) -> Floats:
    return np.full(shape, 0, np.float32)
