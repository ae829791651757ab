"""The gel by finite elements: the layer against it on every object.

    python -m tests.benchmarks.gel objects
    python -m tests.benchmarks.gel record

Each press is printed when it is done. Times are processor times of one thread.
"""

import argparse
import json
import multiprocessing
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import platformdirs
from numpy.typing import NDArray

from gellight_design.simulating.gel_models import source_digest
from sim_reference import gel
from sim_reference.deformation import Deformation, NotConverged, grid
from sim_reference.fem.gel import FemGel, FemPress, coated, solver_of
from sim_reference.geometry import SensorGeometry
from sim_reference.metrics import angular_error
from sim_reference.objects import OBJECT_NAMES, object_height
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE
from tests.helpers.places import CHECKOUT

Array = NDArray[np.float64]
GEOMETRY = SensorGeometry()
SPACING = GRID_EXTENT_MM / GRID_SIZE
AT = grid(GRID_SIZE, SPACING)
INSIDE = np.hypot(AT[None, :], AT[:, None]) < 17.5
EVERY_FOURTH = np.flatnonzero(np.abs(AT) < 17.5)[::4]
RECORDED = np.ix_(EVERY_FOURTH, EVERY_FOURTH)
RECORD = CHECKOUT / "tests/data/fem/objects.npz"
UNIT_MM = 2e-4
"""of the record"""
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True)
class Given:
    """What the command line says."""

    depth_mm: float
    model: FemGel
    names: list[str]
    folder: Path
    """of kept presses"""


@dataclass(frozen=True)
class Timed:
    press: FemPress
    cpu_s: float
    vertices: int


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Of one press: what it took, and its smallest gap and det F of all steps."""

    vertices: int
    cpu_s: float
    wall_s: float
    peak_gb: float
    min_gap_mm: float
    min_det_f: float
    force_n: float
    layer_force_n: float


def heights(name: str) -> Array:
    return object_height(name, AT[None, :], AT[:, None])


def timed(name: str, depth: float, model: FemGel) -> Timed:
    vertices = len(solver_of(model, GEOMETRY).mesh.free)
    begun = time.process_time()
    press = model.press(heights(name), SPACING, depth, GEOMETRY)
    return Timed(press, time.process_time() - begun, vertices)


def normals(depth: Array) -> Array:
    down, across = np.gradient(depth, SPACING)
    upright = np.stack([-across, -down, np.ones_like(depth)], axis=2)
    return np.asarray(upright / np.linalg.norm(upright, axis=2, keepdims=True))


def kept_path(name: str, given: Given) -> Path:
    model = given.model
    said = f"{name}-{given.depth_mm:g}-{model.resolution_mm:g}-{model.dense_radius_mm:g}-{source_digest()[:16]}"
    return given.folder / f"{said}.npz"


def alone(do: Callable[..., Result], *arguments: object) -> Result:
    """Return what `do` returns in a process of its own: its peak memory is that of this work."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(do, *arguments).result()


def press_and_keep(name: str, given: Given) -> None:
    """Press, and write the figures and the coated surface."""
    begun = time.monotonic()
    found = timed(name, given.depth_mm, given.model)
    press, layer = found.press, gel.press(heights(name), SPACING, given.depth_mm, GEOMETRY)
    figures = Figures(
        vertices=found.vertices,
        steps=len(press.steps),
        cpu_s=found.cpu_s,
        wall_s=time.monotonic() - begun,
        peak_gb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        min_gap_mm=press.min_gap_mm,
        min_det_f=press.min_det_f,
        force_n=press.force_n,
        layer_force_n=layer.pressure.sum() * SPACING**2 * press.force_n / press.surface.force,
    )
    surface = coated(press, SPACING, GEOMETRY)
    path = kept_path(name, given)
    half = path.with_suffix(".half.npz")
    np.savez_compressed(half, depth_mm=np.float32(surface.depth_mm), pressure=np.float32(surface.pressure),
                        figures=json.dumps(asdict(figures)))  # fmt: skip
    half.rename(path)


def pressed(name: str, given: Given) -> tuple[Figures, Deformation]:
    """Return a press that was kept, computed if it is not there."""
    path = kept_path(name, given)
    if not path.exists():
        given.folder.mkdir(parents=True, exist_ok=True)
        alone(press_and_keep, name, given)
    with np.load(path) as kept:
        surface = Deformation(kept["depth_mm"].astype(float), kept["pressure"].astype(float), SPACING)
        return Figures(**json.loads(str(kept["figures"]))), surface


def objects(given: Given) -> None:
    """Print the layer against finite elements: heights in um, normals in degrees, in the region and in contact.

    Presses are kept: what was interrupted goes on with the object that was under way.
    """
    print(
        "object    vertices steps  cpu s wall s   GB gap um det F  force N layer/fem"
        "  height region contact  normal region contact"
    )
    for name in given.names:
        try:
            found, fem = pressed(name, given)
        except NotConverged as error:
            print(f"{name:9} {error}", flush=True)
            continue
        layer = gel.press(heights(name), SPACING, given.depth_mm, GEOMETRY)
        contact = INSIDE & layer.contact
        height = np.abs(layer.depth_mm - fem.depth_mm) * 1e3
        angle = np.degrees(angular_error(normals(layer.depth_mm), normals(fem.depth_mm)))
        print(f"{name:9} {found.vertices:8d} {found.steps:5d} {found.cpu_s:6.0f} {found.wall_s:6.0f} "
              f"{found.peak_gb:4.1f} {found.min_gap_mm * 1e3:6.2f} {found.min_det_f:5.2f} "
              f"{found.force_n:8.2f} {found.layer_force_n / found.force_n:9.3f} "
              f"{height[INSIDE].mean():14.1f} {height[contact].mean():7.1f} "
              f"{angle[INSIDE].mean():14.2f} {angle[contact].mean():7.2f}", flush=True)  # fmt: skip


def record(given: Given) -> None:
    """Write the surfaces of the objects that `objects` has kept, every fourth point, where the tests read them.

    What was recorded of other objects stays.
    """
    names = [name for name in given.names if kept_path(name, given).exists()]
    surfaces = {name: pressed(name, given)[1].depth_mm[RECORDED] for name in names}
    units = {name: np.rint(surface / UNIT_MM).astype(np.int16) for name, surface in surfaces.items()}
    with np.load(RECORD) as before:
        np.savez_compressed(RECORD, allow_pickle=False, **(dict(before) | units))
    print(f"{RECORD}: {', '.join(names)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["objects", "record"])
    parser.add_argument("--depth-mm", type=float, default=0.9)
    parser.add_argument("--resolution-mm", type=float, default=0.3, help="of objects and record")
    parser.add_argument("--dense-radius-mm", type=float, default=17.5, help="smaller: fewer vertices, for the ball")
    parser.add_argument("--objects", nargs="+", default=list(OBJECT_NAMES), choices=OBJECT_NAMES, metavar="NAME")
    parser.add_argument("--keep", type=Path, default=platformdirs.user_cache_path("gellight") / "benchmarks")
    args = parser.parse_args()
    given = Given(
        depth_mm=args.depth_mm,
        model=FemGel(resolution_mm=args.resolution_mm, dense_radius_mm=args.dense_radius_mm),
        names=args.objects,
        folder=args.keep,
    )
    run: dict[str, Callable[[Given], None]] = {"objects": objects, "record": record}
    run[args.what](given)


if __name__ == "__main__":
    main()
