"""What this process holds: memory, open files, threads and children, and whether that grows."""

import ctypes
import gc
import os
import re
import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import or_
from pathlib import Path

import numpy as np

FEWEST = 60
"""samples, one a second: a shorter run says nothing about memory"""
FIRST_RESTS = 2
"""rests that later ones are compared with"""
ALLOWED_MB = 4.0
"""the allocator may keep so much more from the third to the last quarter of a run"""


M_ARENA_MAX = -8
"""of `mallopt`, glibc's malloc.h"""


def one_arena() -> None:
    """Let all threads that begin from now on allocate from the same memory, where the C library has arenas.

    Each gets an arena else. What is free between what is kept in them went up and down by 100 MB in 50 connections to
    a simulated sensor, without any leak; from one arena the same 50 took 102.0 to 102.1 MB.
    """
    library = ctypes.CDLL(None)
    if hasattr(library, "mallopt"):
        library.mallopt(M_ARENA_MAX, 1)


@dataclass(frozen=True)
class Holdings:
    """What is held at a moment."""

    at_s: float
    memory_mb: float
    """resident, not of files, without what the allocator keeps of memory that was given back"""
    files: int
    threads: tuple[str, ...]
    """their names, without numbers"""
    children: int

    @classmethod
    def now(cls, at_s: float) -> "Holdings":
        """Look at this process, without what Python or the C library would free later."""
        gc.collect()
        getattr(ctypes.CDLL(None), "malloc_trim", int)(0)
        lines = Path("/proc/self/status").read_text().splitlines()
        resident = next(int(line.split()[1]) for line in lines if line.startswith("RssAnon:")) / 1e3
        tasks = list(Path("/proc/self/task").iterdir())
        children = sum(len((task / "children").read_text().split()) for task in tasks if (task / "children").exists())
        alive = {int(task.name) for task in tasks}  # Python goes on listing threads of libraries that have ended
        names = [thread.name for thread in threading.enumerate() if thread.native_id in alive]
        threads = tuple(re.sub(r"[-_]?\d+", "", name) for name in names)
        return cls(at_s, resident, len(os.listdir("/proc/self/fd")), threads, children)  # noqa: PTH208


def memory_growth_mb(samples: Sequence[Holdings]) -> tuple[float, float]:
    """Return how much more memory the last quarter of a run took than the third, and how much of that may be noise.

    Nothing where there are fewer than `FEWEST` samples. Medians are compared. Noise: `ALLOWED_MB` and three times the
    larger median deviation of the two.
    """
    if len(samples) < FEWEST:
        return 0.0, ALLOWED_MB
    memory = np.array([sample.memory_mb for sample in samples])
    middle, three_quarters = len(memory) // 2, len(memory) * 3 // 4
    third, last = memory[middle:three_quarters], memory[three_quarters:]
    spread = max(float(np.median(np.abs(part - np.median(part)))) for part in (third, last))
    return float(np.median(last) - np.median(third)), ALLOWED_MB + 3 * spread


def handle_growth(rests: Sequence[Holdings]) -> dict[str, int]:
    """Return what is more at the last rest, with no daemon running, than at any of the first two; threads by name."""
    *first, last = [_counted(rest) for rest in (*rests[:FIRST_RESTS], rests[-1])]
    return dict(last - reduce(or_, first))


def _counted(rest: Holdings) -> Counter[str]:
    return Counter(files=rest.files, children=rest.children, **Counter(f"thread {name}" for name in rest.threads))
