"""Numbers written into pictures, so large that compression keeps them: at the top and again at the bottom."""

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError

BLOCK_PX = 8
BITS = 32
BLACK, WHITE = 16, 235


def marked(image: NDArray[np.uint8], number: int) -> NDArray[np.uint8]:
    """Return (H, W, 3) uint8 RGB with `number` in its first and in its last rows; W has room for 16 blocks of a bit."""
    bits = np.array([number >> bit & 1 for bit in range(BITS)], bool).reshape(2, -1)
    grey = np.where(bits, WHITE, BLACK).repeat(BLOCK_PX, axis=0).repeat(BLOCK_PX, axis=1).astype(np.uint8)
    rows, columns = grey.shape
    result = image.copy()
    result[:rows, :columns] = result[-rows:, :columns] = grey[..., None]
    return result


def read_number(image: NDArray[np.uint8]) -> int:
    """Return the number of a picture; InputError where top and bottom are of different pictures."""
    rows, columns = 2 * BLOCK_PX, BITS // 2 * BLOCK_PX
    top, bottom = _number(image[:rows, :columns]), _number(image[-rows:, :columns])
    if top != bottom:
        raise InputError(f"the picture begins as number {top} and ends as number {bottom}: it is torn")
    return top


def _number(part: NDArray[np.uint8]) -> int:
    blocks = part.reshape(2, BLOCK_PX, -1, BLOCK_PX, 3).mean(axis=(1, 3, 4)).ravel()
    return sum(1 << bit for bit, grey in enumerate(blocks) if grey > 128)
