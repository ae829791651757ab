"""One object pressed into the simulated gel, to a depth or with a force, and all that comes of it as files.

The folder holds press.npz (depth_mm, pressure_mpa, tangential_mm and spacing_mm, on a grid about the object) and
report.json. While a press by finite elements is under way it also holds state.npz, from which the same command goes on.
"""

import hashlib
import io
import json
import resource
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from math import inf
from pathlib import Path

import numpy as np

from gellight.base.errors import InputError, first_line
from gellight.base.writing import new_folder, write_file
from gellight.lab.simulator.choices import GelKind
from gellight.lab.simulator.gel_models import DAMAGED, source_digest
from gellight.lab.simulator.memory import check_memory
from gellight.lab.simulator.scene import Array
from sim_reference import gel
from sim_reference.deformation import NotConverged, grid
from sim_reference.fem.gel import FemGel, depth_under, solver_of
from sim_reference.fem.newton import State, Step
from sim_reference.fem.pressing import Checkpoint
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height
from sim_reference.solids import height_map, read_stl
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
    free_at_mm: tuple[float, float] | None = None
    """x, y of the object where the force acts, if the object is free to tilt"""


@dataclass(frozen=True, kw_only=True)
class PressReport:
    """What came of it. The layer has no steps, gap, or vertices of a mesh, and no object that tilts."""

    object_name: str
    gel: GelKind
    depth_mm: float
    """of the object's middle"""
    force_n: float
    tilt_deg: float | None
    """between the object's axis and z"""
    tilt_towards_deg: float | None
    """where the object is deepest: the angle from x towards y; none where it is not free"""
    centre_mm: tuple[float, float, float] | None
    """x, y, z of the object's middle, level with its highest point; it began at 0, 0, 0"""
    newton_steps: int | None
    """all of them, also those before an interruption"""
    min_gap_mm: float | None
    """the smallest gap between gel and object in all of these steps"""
    min_det_f: float | None
    """the smallest volume of a tetrahedron over that at rest in all of these steps"""
    vertices: int | None
    wall_s: float
    """since the command was started, the last time where it was interrupted"""
    peak_memory_gb: float


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
    try:
        with new_folder(folder):
            if request.gel == "fem":
                progress = _Progress(folder, request, geometry, height, show)
                result = _by_finite_elements(request, height, geometry, progress)
            else:
                result = _by_layer(request, height, geometry)
    except (ValueError, NotConverged) as error:
        raise InputError(f"this press cannot be simulated: {error}") from error
    except OSError as error:
        raise InputError(f"the press cannot be written to {folder} ({error.strerror}): choose another --out") from error
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    report = PressReport(**{**asdict(result.report), "wall_s": time.monotonic() - begun, "peak_memory_gb": peak_gb})
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


class _Progress:
    """Keeps the state of a press under way in the folder, and says how far it is."""

    def __init__(
        self, folder: Path, request: PressRequest, geometry: SensorGeometry, height: Array, show: Progress
    ) -> None:
        self.path, self._show = folder / "state.npz", show
        said = f"{source_digest()} {asdict(request)} {asdict(geometry)}"
        self._key = hashlib.sha256(said.encode() + height.tobytes()).hexdigest()
        self.steps = 0
        """of Newton, with those before an interruption; so are the two below"""
        self.min_gap_mm, self.min_det_f = inf, inf

    def kept(self) -> Checkpoint | None:
        """Return where the press was interrupted, None if it was not; raises InputError for another press's state."""
        if not self.path.exists():
            return None
        try:
            with np.load(self.path) as kept:
                if str(kept["key"]) != self._key:
                    raise InputError(
                        f"{self.path} is of another press, or of another version: remove it, or choose another --out"
                    )
                state = State(kept["at"], float(kept["depth_mm"]), kept["matrix"])
                self.steps = int(kept["steps"])
                self.min_gap_mm, self.min_det_f = float(kept["min_gap_mm"]), float(kept["min_det_f"])
                return Checkpoint(state, float(kept["increment_mm"]), bool(kept["narrow"]), float(kept["gap_share"]),
                                  kept["anchor"], kept["layer_mm"])  # fmt: skip
        except DAMAGED as error:
            raise InputError(
                f"{self.path} cannot be read ({first_line(error)}): remove it, the press begins anew"
            ) from error

    def keep(self, step: Step, checkpoint: Checkpoint) -> None:
        """Write the state, so that an interruption costs one step."""
        self.steps += 1
        self.min_gap_mm = min(self.min_gap_mm, step.min_gap_mm)
        self.min_det_f = min(self.min_det_f, step.min_det_f)
        content = io.BytesIO()
        np.savez(
            content,
            key=self._key,
            steps=self.steps,
            min_gap_mm=self.min_gap_mm,
            min_det_f=self.min_det_f,
            at=checkpoint.state.at,
            depth_mm=checkpoint.state.depth_mm,
            matrix=checkpoint.state.matrix,
            increment_mm=checkpoint.increment_mm,
            narrow=checkpoint.narrow,
            gap_share=checkpoint.gap_share,
            anchor=checkpoint.anchor,
            layer_mm=checkpoint.layer_mm,
        )
        write_file(self.path, content.getvalue())
        self._show(replace(step, number=self.steps))


def _by_finite_elements(request: PressRequest, height: Array, geometry: SensorGeometry, progress: _Progress) -> _Result:
    check_memory(request.resolution_mm, geometry)
    model = FemGel(resolution_mm=request.resolution_mm, friction=request.friction)
    depth = request.depth_mm
    if depth is None:
        depth = depth_under(request.force_n or 0.0, height, SPACING_MM, model, geometry)
    pressed = model.press(
        height,
        SPACING_MM,
        depth,
        geometry,
        load_n=request.force_n,
        free_at_mm=request.free_at_mm,
        on_step=progress.keep,
        resume=progress.kept(),
    )
    x, y, z = (float(at) for at in pressed.centre_mm)
    towards = float(np.degrees(np.arctan2(*pressed.slopes[::-1])))
    report = PressReport(
        object_name=request.object_name,
        gel=request.gel,
        depth_mm=z,
        force_n=pressed.force_n,
        tilt_deg=float(np.degrees(pressed.tilt_rad)),
        tilt_towards_deg=None if request.free_at_mm is None else towards,
        centre_mm=(x, y, z),
        newton_steps=progress.steps,
        min_gap_mm=progress.min_gap_mm,
        min_det_f=progress.min_det_f,
        vertices=len(solver_of(model, geometry).mesh.free),
        wall_s=0.0,
        peak_memory_gb=0.0,
    )
    surface = pressed.surface
    pressure_mpa = surface.pressure * model.shear_modulus_mpa(geometry)
    return _Result(surface.depth_mm, pressure_mpa, surface.tangential_mm, report)


def _by_layer(request: PressRequest, height: Array, geometry: SensorGeometry) -> _Result:
    if request.free_at_mm is not None:
        raise ValueError("an object that is free to tilt: the elastic layer knows none, give --gel fem")
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
        tilt_deg=None,
        tilt_towards_deg=None,
        centre_mm=None,
        newton_steps=None,
        min_gap_mm=None,
        min_det_f=None,
        vertices=None,
        wall_s=0.0,
        peak_memory_gb=0.0,
    )
    return _Result(pressed.depth_mm, pressure_mpa, np.zeros((*height.shape, 2)), report)


def _write(folder: Path, result: _Result, report: PressReport) -> None:
    content = io.BytesIO()
    np.savez_compressed(
        content,
        depth_mm=np.float32(result.depth_mm),
        pressure_mpa=np.float32(result.pressure_mpa),
        tangential_mm=np.float32(result.tangential_mm),
        spacing_mm=SPACING_MM,
    )
    write_file(folder / "press.npz", content.getvalue())
    write_file(folder / "report.json", json.dumps(asdict(report), indent=2).encode())
    (folder / "state.npz").unlink(missing_ok=True)
