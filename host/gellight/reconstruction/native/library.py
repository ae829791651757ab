"""The library of the frame path that fits this machine, loaded by ctypes."""

import ctypes
import hashlib
import platform
import sys
from pathlib import Path

from gellight.reconstruction.native.build import CHECKSUMS, library_file

_SIGNATURES = {
    "difference_and_means": "ppppppii",
    "touched_cells": "ppppppii",
    "cell_rows": "ppppii",
    "coarse_rows": "ppii",
    "store_cells": "ppppppiii",
    "blend": "ppippfppppii",
    "pixel_rows": "pppii",
    "store_pixels": "ppppiii",
    "narrow": "pppifpppii",
    "divergence": "ppffpii",
    "solve_columns": "pppii",
    "resting_depths": "pppiiipii",
    "level_and_slopes": "pfpffpii",
    "widen": "pppppppppiiiiii",
    "slopes_and_normals": "pppii",
    "find_contact": "pfpppppppii",
}
"""arguments of each function: pointer, int, float"""
_COUNTING = ("touched_cells", "cell_rows", "blend", "resting_depths")
"""functions that return an int; the others return nothing"""
_KINDS = {"p": ctypes.c_void_p, "i": ctypes.c_int, "f": ctypes.c_float}


_FEATURES = {
    "x86_64-v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "x86_64-v3": {"avx2", "fma", "bmi1", "bmi2", "f16c", "movbe", "abm"},
    "x86_64-v2": {"sse4_2", "popcnt"},
}
"""library: what the processor must have, in Linux's words; each needs those of the slower ones too"""


def fitting() -> tuple[str, ...]:
    """Return the names of the libraries that run on this machine, the fastest first; empty where none does."""
    if not sys.platform.startswith("linux") or sys.maxsize < 2**32:
        return ()
    if platform.machine() == "aarch64":
        return ("aarch64",)
    if platform.machine() != "x86_64":
        return ()
    have = _processor_flags()
    return tuple(name for name, needed in _FEATURES.items() if needed <= have)


def _processor_flags() -> set[str]:
    """What Linux says the processor can do, and lets programs use."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return set()
    return set(next((line.partition(":")[2].split() for line in lines if line.startswith("flags")), []))


class NativePathError(Exception):
    """The native path cannot be used here; the text says why."""


def fitting_library() -> tuple[str, ctypes.CDLL]:
    """Return the fastest library that runs on this machine, and its name; NativePathError where none does."""
    names = fitting()
    if not names:
        raise NativePathError(f"no library is built for {sys.platform} on {platform.machine()}")
    path = library_file(names[0])
    check_whole(path)
    return names[0], load(path)


def check_whole(path: Path) -> None:
    """Raise NativePathError unless a library is as it was built: loading a damaged one can end the process."""
    try:
        found, listed = hashlib.sha256(path.read_bytes()).hexdigest(), CHECKSUMS.read_text().split()
    except OSError as error:
        raise NativePathError(f"{error.filename} cannot be read ({error.strerror}): install gellight again") from error
    expected = dict(zip(listed[1::2], listed[::2], strict=True)).get(path.name)
    if found != expected:
        raise NativePathError(f"{path} is damaged (SHA-256 {found}, not {expected}): install gellight again")


def load(path: Path) -> ctypes.CDLL:
    """Load a library and declare its functions; NativePathError where that fails."""
    try:
        library = ctypes.CDLL(str(path))
        for name, kinds in _SIGNATURES.items():
            function = getattr(library, name)
            function.argtypes = [_KINDS[kind] for kind in kinds]
            function.restype = ctypes.c_int if name in _COUNTING else None
    except (OSError, AttributeError) as error:
        raise NativePathError(f"{path} cannot be loaded ({error}): install gellight again") from error
    return library
