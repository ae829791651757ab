"""One object pressed into the simulated gel and dragged along a path, with friction, and what comes of it as files.

The path is a CSV file with the columns x_mm, y_mm, z_mm (deeper) and turn_deg (from x towards y). A row is where the
object is, from where the press has left it. The folder holds pose-000.npz, the press, and one for each row: what
press.npz holds, on a grid about where the press was. report.json has the forces.
"""

import io
import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from gellight.base.csv_file import Row, number_in, read_rows
from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.lab.simulator.scene import Array
from gellight_design.simulating.gel_models import check_memory
from gellight_design.simulating.new_folder import new_folder
from gellight_design.simulating.one_press import SPACING_MM, PressRequest, Progress, object_heights
from sim_reference.deformation import NotConverged
from sim_reference.fem.dragging import Dragged, Pose, drag
from sim_reference.fem.gel import FemGel, solver_of
from sim_reference.fem.pressing import Checkpoint
from sim_reference.fem.sampling import sample_surface
from sim_reference.geometry import SensorGeometry

COLUMNS = ("x_mm", "y_mm", "z_mm", "turn_deg")


@dataclass(frozen=True, kw_only=True)
class PoseReport:
    """What came of one pose."""

    x_mm: float
    y_mm: float
    z_mm: float
    turn_deg: float
    force_n: tuple[float, float, float]
    """of the object on the gel"""
    torque_nmm: float
    """about z, at the object's highest point, from x towards y"""
    sticks: float
    """share of the vertices in contact that do not slip"""


@dataclass(frozen=True, kw_only=True)
class DragReport:
    """What came of the press, the first of the poses, and of the path."""

    object_name: str
    depth_mm: float
    friction: float
    poses: tuple[PoseReport, ...]


def read_path(path: Path) -> list[Pose]:
    """Read a path; raises InputError, naming the line, for what is none."""
    rows = read_rows(path, "path", COLUMNS)
    if not rows:
        raise InputError(f"{path} has no poses: add a line for each")
    return [_pose(row, f"{path}, line {line}") for line, row in rows]


def _pose(row: Row, where: str) -> Pose:
    x, y, z, turn = (number_in(row, column, where) for column in COLUMNS)
    return Pose((x, y, z), (0.0, 0.0, math.radians(turn)))


def drag_once(
    request: PressRequest, path: list[Pose], folder: Path, geometry: SensorGeometry, show: Progress
) -> DragReport:
    """Press to a depth, drag along the path and write the files; `show` is called after each of Newton's steps.

    Raises InputError for what cannot be dragged, would not fit the memory, or cannot be written.
    """
    depth = request.depth_mm
    if depth is None or request.gel != "fem":
        raise InputError("a path is of finite elements, from a depth: give --depth-mm and --gel fem")
    for number, pose in enumerate(path, 1):
        if not 0 < depth + pose.move_mm[2] <= geometry.deepest_press_mm:
            raise InputError(
                f"pose {number} is {depth + pose.move_mm[2]:g} mm deep: finite elements go from above 0 to "
                f"{geometry.deepest_press_mm:g} mm"
            )
    check_memory(request.resolution_mm, geometry)
    try:
        with new_folder(folder):
            report = _Drag(request, depth, [Pose(), *path], folder, geometry, show).run()
        write_file(folder / "report.json", json.dumps(asdict(report), indent=2).encode())
    except OSError as error:
        raise InputError(f"the drag cannot be written to {folder} ({error.strerror}): choose another --out") from error
    return report


class _Drag:
    """A drag under way in a folder."""

    def __init__(
        self,
        request: PressRequest,
        depth_mm: float,
        path: list[Pose],
        folder: Path,
        geometry: SensorGeometry,
        show: Progress,
    ) -> None:
        self._request, self._depth_mm, self._path, self._folder = request, depth_mm, path, folder
        self._geometry, self._show, self._height = geometry, show, object_heights(request.object_name)
        self._model = FemGel(resolution_mm=request.resolution_mm, friction=request.friction)

    def run(self) -> DragReport:
        """Take the poses, each from where the last has ended."""
        poses: list[PoseReport] = []
        checkpoint: Checkpoint | None = None
        for number in range(len(self._path)):
            one = self._take(number, checkpoint)
            checkpoint, poses = one.checkpoint, [*poses, _told(one)]
            write_file(self._folder / f"pose-{number:03d}.npz", self._sampled(one))
        request = self._request
        return DragReport(object_name=request.object_name, depth_mm=self._depth_mm, friction=request.friction,
                          poses=tuple(poses))  # fmt: skip

    def _take(self, number: int, checkpoint: Checkpoint | None) -> Dragged:
        try:
            return drag(self._model, self._height, SPACING_MM, self._depth_mm, [self._path[number]], self._geometry,
                        on_step=self._show, resume=checkpoint)[0]  # fmt: skip
        except (ValueError, NotConverged) as error:
            what = f"pose {number} of the path" if number else "this press"
            raise InputError(f"{what} cannot be simulated: {error}") from error

    def _sampled(self, one: Dragged) -> bytes:
        mesh, at = solver_of(self._model, self._geometry).mesh, one.checkpoint.state.at
        surface = sample_surface(mesh, at, one.barrier, len(self._height), SPACING_MM)
        pressure: Array = surface.pressure * self._model.shear_modulus_mpa(self._geometry)
        content = io.BytesIO()
        np.savez_compressed(content, depth_mm=np.float32(surface.depth_mm), pressure_mpa=np.float32(pressure),
                            tangential_mm=np.float32(surface.tangential_mm), spacing_mm=SPACING_MM)  # fmt: skip
        return content.getvalue()


def _told(one: Dragged) -> PoseReport:
    x, y, z = one.pose.move_mm
    fx, fy, fz = (float(force) for force in one.force_n)
    sticks, turn = float(one.sticks.sum() / max(1, one.touches.sum())), math.degrees(one.pose.turn_rad[2])
    return PoseReport(x_mm=x, y_mm=y, z_mm=z, turn_deg=turn, force_n=(fx, fy, fz), torque_nmm=one.torque_nmm,
                      sticks=sticks)  # fmt: skip
