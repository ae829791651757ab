"""The models of the gel that a simulated sensor can have, and the presses of the slow one, kept on the disk.

A press by finite elements takes a minute, so each is kept under a digest of all that it depends on: the object's
heights, the depth, the gel, the model and the simulator's source. A press that is there is read in a few milliseconds.
"""

import hashlib
import logging
import os
import zipfile
import zlib
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np
import platformdirs

import sim_reference
from gellight.base.errors import InputError, first_line
from gellight.base.writing import write_file
from gellight.bundle.contents import npz
from gellight.lab.simulator.scene import Array
from gellight_design.simulating.choices import RESOLUTION_MM, GelKind
from sim_reference import gel
from sim_reference.deformation import Deformation, GelModel, NotConverged
from sim_reference.fem.gel import FemGel
from sim_reference.fem.mesh import vertices_needed
from sim_reference.geometry import SensorGeometry

logger = logging.getLogger(__name__)


DAMAGED = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error)
"""what NumPy raises for an .npz that cannot be read, or lacks a field"""


def gel_model(kind: GelKind, resolution_mm: float = RESOLUTION_MM) -> GelModel:
    """Return the model; `resolution_mm` is that of the finite elements."""
    return KeptPresses(FemGel(resolution_mm=resolution_mm)) if kind == "fem" else gel.press


def kept_folder() -> Path:
    """Return where presses are kept by default."""
    return platformdirs.user_cache_path("gellight") / "presses"


@dataclass(frozen=True)
class KeptPresses:
    """A `GelModel` that keeps what finite elements found."""

    model: FemGel
    folder: Path | None = None
    """default: the user's cache"""

    def __call__(
        self, object_height_mm: Array, spacing_mm: float, press_depth_mm: float, geometry: SensorGeometry
    ) -> Deformation:
        """Return the press, computed if it is not there; see `deformation.GelModel`.

        Raises InputError for what cannot be pressed or kept.
        """
        if press_depth_mm == 0:
            return self.model(object_height_mm, spacing_mm, press_depth_mm, geometry)
        folder = self.folder or kept_folder()
        path = folder / f"{self.key(object_height_mm, spacing_mm, press_depth_mm, geometry)}.npz"
        if path.exists():
            return _read(path, spacing_mm)
        logger.warning("the press of %g mm is computed by finite elements: this takes a minute, once", press_depth_mm)
        try:
            pressed = self.model(object_height_mm, spacing_mm, press_depth_mm, geometry)
        except (ValueError, NotConverged) as error:
            raise InputError(f"this press cannot be simulated: {error}") from error
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_file(path, _written(pressed))
        except OSError as error:
            raise InputError(f"the press cannot be kept in {folder} ({error.strerror}): make room there") from error
        return pressed

    def key(self, object_height_mm: Array, spacing_mm: float, press_depth_mm: float, geometry: SensorGeometry) -> str:
        """Return the digest that names a press."""
        shape = (
            geometry.gel_diameter_mm,
            geometry.gel_thickness_mm,
            geometry.poisson_ratio,
            geometry.coating_smoothing_mm,
        )
        said = f"{source_digest()} {asdict(self.model)} {shape} {spacing_mm!r} {press_depth_mm!r}"
        return hashlib.sha256(said.encode() + np.ascontiguousarray(object_height_mm, np.float64).tobytes()).hexdigest()


@cache
def source_digest() -> str:
    """Return the digest of the source that a press by finite elements depends on."""
    folder = Path(sim_reference.__path__[0])
    files = sorted([*(folder / "fem").glob("*.py"), folder / "gel.py"])
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def _written(pressed: Deformation) -> bytes:
    # A hundredth of a nanometre is lost, and half of the disk saved.
    return npz({"depth_mm": pressed.depth_mm.astype(np.float32), "pressure": pressed.pressure.astype(np.float32)})


def _read(path: Path, spacing_mm: float) -> Deformation:
    """Raises InputError for a damaged file."""
    try:
        with np.load(path) as kept:
            return Deformation(kept["depth_mm"].astype(np.float64), kept["pressure"].astype(np.float64), spacing_mm)
    except DAMAGED as error:
        raise InputError(
            f"the kept press {path} cannot be read ({first_line(error)}): remove it, it is made again"
        ) from error


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
