"""Numbers written into pictures, at the top and again at the bottom, so faintly that no touch is seen in them.

A bit is a column of four rows, brighter and darker by `STEP_GREY` in turn: neither the mean nor the slope of the block
changes, and a picture that changes as smoothly as gel does not change the bit.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError

BITS = 32
ROWS = 4
STEP_GREY = 2
SIGNS = np.array([1, -1, -1, 1])


def marked(image: NDArray[np.uint8], number: int) -> NDArray[np.uint8]:
    """Return (H, W, 3) uint8 RGB with `number` in its first and last four rows; W is a multiple of 32."""
    bits = np.array([number >> bit & 1 for bit in range(BITS)]).repeat(image.shape[1] // BITS)
    step = STEP_GREY * (1 + np.where(bits, 1, -1) * SIGNS[:, None])[..., None]
    result = image.copy()
    for rows in (slice(ROWS), slice(-ROWS, None)):
        result[rows] = np.minimum(image[rows] + step, 255)
    return result


def read_number(image: NDArray[np.uint8]) -> int:
    """Return the number of a picture; InputError where top and bottom are of different pictures."""
    top, bottom = _number(image[:ROWS]), _number(image[-ROWS:])
    if top != bottom:
        raise InputError(f"the picture begins as number {top} and ends as number {bottom}: it is torn")
    return top


def _number(part: NDArray[np.uint8]) -> int:
    columns = part.reshape(ROWS, BITS, -1).astype(float).mean(axis=2)
    return sum(1 << bit for bit, step in enumerate(SIGNS @ columns) if step > 0)
