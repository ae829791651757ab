"""One object pressed into the simulated gel, to a depth or with a force, and all that comes of it as files.

The folder holds press.npz (depth_mm, pressure_mpa, tangential_mm and spacing_mm, on a grid about the object) and
report.json.
"""

import json
import resource
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.bundle.contents import npz
from gellight.lab.simulator.objects import object_height
from gellight.lab.simulator.scene import Array
from gellight_design.simulating.choices import GelKind
from gellight_design.simulating.gel_models import check_memory
from gellight_design.simulating.new_folder import new_folder
from gellight_design.simulating.solids import height_map, read_stl
from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.fem.gel import FemGel, depth_under, solver_of
from sim_reference.fem.newton import Step
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE

SPACING_MM = GRID_EXTENT_MM / GRID_SIZE
Progress = Callable[[Step], None]


@dataclass(frozen=True, kw_only=True)
class PressRequest:
    """What is pressed, how, and into which gel."""

    object_name: str
    """one of the simulator's objects, or an STL file"""
    depth_mm: float | None
    force_n: float | None
    """one of the two"""
    gel: GelKind
    resolution_mm: float
    friction: float


@dataclass(frozen=True, kw_only=True)
class PressReport:
    """What came of it. The layer has no steps, gap, or vertices of a mesh."""

    object_name: str
    gel: GelKind
    depth_mm: float
    """of the object's highest point"""
    force_n: float
    newton_steps: int | None = None
    min_gap_mm: float | None = None
    """the smallest gap between gel and object in all of these steps"""
    min_det_f: float | None = None
    """the smallest volume of a tetrahedron over that at rest in all of these steps"""
    vertices: int | None = None
    wall_s: float = 0.0
    peak_memory_gb: float = 0.0


@dataclass(frozen=True, eq=False)
class _Result:
    depth_mm: Array
    pressure_mpa: Array
    tangential_mm: Array
    report: PressReport


def press_once(request: PressRequest, folder: Path, geometry: SensorGeometry, show: Progress) -> PressReport:
    """Press and write the files; `show` is called after each of Newton's steps.

    Raises InputError for what cannot be pressed, would not fit the memory, or cannot be written.
    """
    height = object_heights(request.object_name)
    begun = time.monotonic()
    with new_folder(folder, "press"):
        if request.gel == "fem":
            result = _by_finite_elements(request, height, geometry, show)
        else:
            result = _by_layer(request, height, geometry)
        peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        report = replace(result.report, wall_s=time.monotonic() - begun, peak_memory_gb=peak_gb)
        _write(folder, result, report)
    return report


def object_heights(name: str) -> Array:
    """Return the height map of an object of the simulator, in any case, or of an STL file; raises InputError."""
    at = grid(GRID_SIZE, SPACING_MM)
    is_file = name.lower().endswith(".stl")
    if not is_file and "/" in name:
        raise InputError(f"{name} is not a .stl file: convert it, or give the name of an object of the simulator")
    try:
        if not is_file:
            return object_height(name.upper(), at[None, :], at[:, None])
    except ValueError as error:
        raise InputError(f"{error}, or give a .stl file") from error
    try:
        return height_map(read_stl(Path(name).read_bytes()), GRID_SIZE, SPACING_MM)
    except OSError as error:
        raise InputError(f"{name} cannot be read ({error.strerror}): give a .stl file") from error
    except ValueError as error:
        raise InputError(f"{name} cannot be pressed: {error}") from error


def _by_finite_elements(request: PressRequest, height: Array, geometry: SensorGeometry, show: Progress) -> _Result:
    check_memory(request.resolution_mm, geometry)
    model = FemGel(resolution_mm=request.resolution_mm, friction=request.friction)
    if request.depth_mm is not None:
        pressed = model.press(height, SPACING_MM, request.depth_mm, geometry, on_step=show)
    else:
        pressed = model.press_under(request.force_n or 0.0, height, SPACING_MM, geometry, on_step=show)
    report = PressReport(
        object_name=request.object_name,
        gel=request.gel,
        depth_mm=pressed.depth_mm,
        force_n=pressed.force_n,
        newton_steps=len(pressed.steps),
        min_gap_mm=pressed.min_gap_mm,
        min_det_f=pressed.min_det_f,
        vertices=len(solver_of(model, geometry).mesh.free),
    )
    surface = pressed.surface
    pressure_mpa = surface.pressure * model.shear_modulus_mpa(geometry)
    return _Result(surface.depth_mm, pressure_mpa, surface.tangential_mm, report)


def _by_layer(request: PressRequest, height: Array, geometry: SensorGeometry) -> _Result:
    if request.friction:
        raise ValueError(f"friction {request.friction:g}: the elastic layer knows none, give --gel fem")
    model = FemGel()
    depth = request.depth_mm
    if depth is None:
        depth = depth_under(request.force_n or 0.0, height, SPACING_MM, model, geometry, tolerance=1e-6)
    pressed = gel.press(height, SPACING_MM, depth, geometry)
    pressure_mpa = pressed.pressure * model.shear_modulus_mpa(geometry)
    report = PressReport(
        object_name=request.object_name,
        gel=request.gel,
        depth_mm=depth,
        force_n=float(pressure_mpa.sum()) * SPACING_MM**2,
    )
    return _Result(pressed.depth_mm, pressure_mpa, np.zeros((*height.shape, 2)), report)


def _write(folder: Path, result: _Result, report: PressReport) -> None:
    maps = {name: getattr(result, name).astype(np.float32) for name in ("depth_mm", "pressure_mpa", "tangential_mm")}
    write_file(folder / "press.npz", npz({**maps, "spacing_mm": np.array(SPACING_MM)}))
    write_file(folder / "report.json", json.dumps(asdict(report), indent=2).encode())
