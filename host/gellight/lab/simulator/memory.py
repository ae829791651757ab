"""Whether finite elements fit the memory: estimated before a mesh is made."""

import os
from pathlib import Path

from gellight.base.errors import InputError
from sim_reference.fem.mesh import vertices_needed
from sim_reference.geometry import SensorGeometry

PROCESS_BYTES, VERTEX_BYTES = 200_000_000, 18_000
"""of a process that presses: 10 to 15 kB a vertex were measured, from 13 000 to 131 000 vertices"""
MEMINFO = Path("/proc/meminfo")


def check_memory(resolution_mm: float, geometry: SensorGeometry, processes: int = 1) -> None:
    """Raise InputError for a mesh that, made in each of `processes`, would not fit the free memory."""
    available = free_memory()

    def needed(resolution: float) -> int:
        return processes * (PROCESS_BYTES + vertices_needed(geometry, resolution) * VERTEX_BYTES)

    if needed(resolution_mm) <= available:
        return
    coarsest = geometry.gel_thickness_mm / 2
    fits = resolution_mm
    while needed(fits) > available and fits < coarsest:
        fits *= 1.1
    remedy = f"{fits:.2g} mm fits" if needed(fits) <= available else "use fewer --workers, or free some memory"
    each = f" in each of {processes} --workers" if processes > 1 else ""
    raise InputError(
        f"a mesh of {resolution_mm:g} mm{each} needs about {needed(resolution_mm) / 1e9:.1f} GB of memory and "
        f"{available / 1e9:.1f} GB are free: {remedy}"
    )


def free_memory() -> int:
    """Return how many bytes programs can still take: on Linux with what the kernel keeps of files, which it gives up.

    Elsewhere all of the memory: what is free is not said.
    """
    if MEMINFO.exists():
        sizes = dict(line.split(":") for line in MEMINFO.read_text().splitlines())
        return int(sizes["MemAvailable"].split()[0]) * 1024
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
