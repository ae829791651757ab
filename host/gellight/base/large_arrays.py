"""Memory of large arrays, given back to the system as soon as they are gone."""

import ctypes
import sys

M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8
"""of `mallopt`, glibc's malloc.h"""
ARENAS = 2
"""else each of some twenty threads keeps its own"""
LARGE_BYTES = 1 << 20
"""smaller than any map of a picture"""


def give_back_large_arrays() -> None:
    """Let the C library take large arrays from the system one by one; a no-op where it is not glibc.

    Else it learns from the first that is freed to keep up to 32 MB of such memory in the arena of each thread, in
    pieces that no later array fits.
    """
    if sys.platform != "linux":
        return
    c_library = ctypes.CDLL(None)
    if hasattr(c_library, "mallopt"):
        c_library.mallopt(M_MMAP_THRESHOLD, LARGE_BYTES)
        c_library.mallopt(M_ARENA_MAX, ARENAS)
