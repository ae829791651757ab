"""Arrays for results, whose memory is used again when nobody has them any more.

Fresh memory comes from the system in pages that are filled with zeros when they are first written: that takes as long
as half a frame.
"""

import ctypes
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.native.cosine import aligned

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
