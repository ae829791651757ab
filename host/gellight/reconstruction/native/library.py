"""The library of the frame path that fits this machine, loaded by ctypes."""

import ctypes
import hashlib
import platform
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import first_line

FOLDER = Path(__file__).parent
CHECKSUMS = FOLDER / "libraries.sha256"
SIGNATURES = {
    "difference_and_means": "ppppppii",
    "touched_cells": "ppppppii",
    "mean_rows": "pppii",
    "coarse_slopes": "pppfppii",
    "split_cells": "pppfpppii",
    "chosen_rows": "ppppi",
    "store_cells": "ppppppii",
    "cells_from_blocks": "pppppii",
    "cell_doubts": "pppppii",
    "blend": "ppipppfppppii",
    "pixel_rows": "pppii",
    "store_pixels": "ppppiii",
    "prefilter": "pppifpppii",
    "divergence": "ppffpii",
    "solve_columns": "pppii",
    "resting_depths": "pppiiipii",
    "level_and_slopes": "pfpffpii",
    "kept_rows": "p",
    "smooth_adaptively": "ppppppppppiiiiii",
    "slopes_by_view": "pppfii",
    "depth_by_view": "pfii",
    "gradient_map": "ppii",
    "find_contact": "pffpppppppppii",
    "measure_parts": "ppppppfippii",
    "slope_means": "pppii",
    "may_shade": "pppppiffppii",
    "lost_light": "pppppppiffffppppiiii",
    "relit": "ppppppffpppi",
    "answered": "pppppii",
    "add_change": "pppii",
    "network_slopes": "pppi",
    "network_jacobian": "ppppi",
}
"""arguments of each function: pointer, int, float"""
_COUNTING = (
    "touched_cells",
    "coarse_slopes",
    "split_cells",
    "chosen_rows",
    "blend",
    "resting_depths",
    "kept_rows",
    "may_shade",
    "lost_light",
    "relit",
    "measure_parts",
)
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


class Library:
    """The functions of the frame path, for arrays and numbers."""

    def __init__(self, path: Path) -> None:
        """Load a file; NativePathError where that fails."""
        try:
            loaded = ctypes.CDLL(str(path))
            self._functions = {name: getattr(loaded, name) for name in SIGNATURES}
        except (OSError, AttributeError) as error:
            raise NativePathError(f"{path} cannot be loaded ({first_line(error)}): install gellight again") from error
        for name, kinds in SIGNATURES.items():
            self._functions[name].argtypes = [_KINDS[kind] for kind in kinds]
            self._functions[name].restype = ctypes.c_int if name in _COUNTING else None

    def call(self, function: str, *arguments: NDArray[Any] | float) -> int:
        """Call a function with contiguous arrays and numbers; return what it counts, 0 for others."""
        given = [address(a) if isinstance(a, np.ndarray) else a for a in arguments]
        return int(self._functions[function](*given) or 0)


def address(array: NDArray[Any]) -> int:
    """Where a contiguous array lies."""
    # A third of the time that `array.ctypes.data` takes, which counts at eighty a frame.
    return int(array.__array_interface__["data"][0])


def fitting_library() -> tuple[str, Library]:
    """Return the fastest library that runs on this machine, and its name; NativePathError where none does."""
    names = fitting()
    if not names:
        raise NativePathError(f"no library is built for {sys.platform} on {platform.machine()}")
    path = library_file(names[0])
    check_whole(path)
    return names[0], Library(path)


def library_file(name: str) -> Path:
    """Return where the library of this name lies, as firmware/tools/libraries.py builds it."""
    return FOLDER / f"frame_path-linux-{name}.so"


def check_whole(path: Path, checksums: Path = CHECKSUMS) -> None:
    """Raise NativePathError unless a library is as it was built: loading a damaged one can end the process."""
    try:
        found, listed = hashlib.sha256(path.read_bytes()).hexdigest(), checksums.read_text().split()
    except OSError as error:
        raise NativePathError(f"{error.filename} cannot be read ({error.strerror}): install gellight again") from error
    expected = dict(zip(listed[1::2], listed[::2], strict=True)).get(path.name)
    if found != expected:
        raise NativePathError(f"{path} is damaged (SHA-256 {found}, not {expected}): install gellight again")
