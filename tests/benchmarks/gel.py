"""The gel by finite elements: the layer against it on every object, its convergence, and its time by vertices.

    python -m tests.benchmarks.gel objects --resolution-mm 0.3
    python -m tests.benchmarks.gel convergence --depth-mm 0.5
    python -m tests.benchmarks.gel scaling

Each press is printed when it is done. Times are processor times of one thread.
"""

import argparse
import resource
import time
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.fem.gel import FemGel, FemPress, coated, solver_of
from sim_reference.geometry import SensorGeometry
from sim_reference.metrics import angular_error
from sim_reference.objects import OBJECT_NAMES, object_height
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE

Array = NDArray[np.float64]
GEOMETRY = SensorGeometry()
SPACING = GRID_EXTENT_MM / GRID_SIZE
AT = grid(GRID_SIZE, SPACING)
INSIDE = np.hypot(AT[None, :], AT[:, None]) < 17.5


@dataclass(frozen=True)
class Timed:
    press: FemPress
    cpu_s: float
    vertices: int


def heights(name: str) -> Array:
    return object_height(name, AT[None, :], AT[:, None])


def timed(name: str, depth: float, model: FemGel) -> Timed:
    begun = time.process_time()
    press = model.press(heights(name), SPACING, depth, GEOMETRY)
    return Timed(press, time.process_time() - begun, len(solver_of(model, GEOMETRY).mesh.free))


def normals(depth: Array) -> Array:
    down, across = np.gradient(depth, SPACING)
    upright = np.stack([-across, -down, np.ones_like(depth)], axis=2)
    return np.asarray(upright / np.linalg.norm(upright, axis=2, keepdims=True))


def objects(depth: float, model: FemGel) -> None:
    """Print the layer against finite elements: heights in um, normals in degrees, in the region and in contact."""
    print(
        "object    vertices steps  cpu s   GB gap um det F  force layer/fem"
        "  height region contact  normal region contact"
    )
    for name in OBJECT_NAMES:
        found = timed(name, depth, model)
        layer, press = gel.press(heights(name), SPACING, depth, GEOMETRY), found.press
        fem = coated(press, SPACING, GEOMETRY)
        contact = INSIDE & layer.contact
        height = np.abs(layer.depth_mm - fem.depth_mm) * 1e3
        angle = np.degrees(angular_error(normals(layer.depth_mm), normals(fem.depth_mm)))
        ratio = layer.pressure.sum() * SPACING**2 / press.surface.force
        peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        print(f"{name:9} {found.vertices:8d} {len(press.steps):5d} {found.cpu_s:6.0f} {peak_gb:4.1f} "
              f"{press.min_gap_mm * 1e3:6.2f} {press.min_det_f:5.2f} {ratio:16.3f} "
              f"{height[INSIDE].mean():14.1f} {height[contact].mean():7.1f} "
              f"{angle[INSIDE].mean():14.2f} {angle[contact].mean():7.2f}", flush=True)  # fmt: skip


def convergence(depth: float, model: FemGel) -> None:
    """Print the ball at three resolutions, each half of the one before: changes, order and extrapolated error."""
    middle = np.hypot(AT[None, :], AT[:, None]) < 4
    presses = []
    for resolution in (0.6, 0.3, 0.15):
        found = timed("BALL", depth, replace(model, resolution_mm=resolution))
        presses.append(found.press)
        print(f"{resolution:5} mm: {found.vertices} vertices, {len(found.press.steps)} steps, {found.cpu_s:.0f} s, "
              f"{found.press.force_n:.4f} N", flush=True)  # fmt: skip
    changes = [np.abs(b.surface.depth_mm - a.surface.depth_mm)[middle].mean() * 1e3
               for a, b in pairwise(presses)]  # fmt: skip
    order = np.log2(changes[0] / changes[1])
    print(f"mean height changes by {changes[0]:.2f} and {changes[1]:.2f} um within 4 mm: order {order:.2f}, "
          f"error left at 0.15 mm {changes[1] / (2**order - 1):.2f} um")  # fmt: skip


def scaling(depth: float, model: FemGel) -> None:
    """Print a Newton step's time by the number of vertices, and the exponent between them."""
    before: tuple[int, float] | None = None
    for resolution in (0.6, 0.4, 0.3, 0.2):
        found = timed("BALL", depth, replace(model, resolution_mm=resolution))
        step_s = found.cpu_s / len(found.press.steps)
        exponent = np.log(step_s / before[1]) / np.log(found.vertices / before[0]) if before else float("nan")
        print(f"{found.vertices:7d} vertices: {step_s:.2f} s a step, {len(found.press.steps)} steps, N^{exponent:.2f}",
              flush=True)  # fmt: skip
        before = found.vertices, step_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["objects", "convergence", "scaling"])
    parser.add_argument("--depth-mm", type=float, default=0.9)
    parser.add_argument("--resolution-mm", type=float, default=0.3)
    parser.add_argument("--dense-radius-mm", type=float, default=17.5, help="smaller: fewer vertices, for the ball")
    given = parser.parse_args()
    model = FemGel(resolution_mm=given.resolution_mm, dense_radius_mm=given.dense_radius_mm)
    {"objects": objects, "convergence": convergence, "scaling": scaling}[given.what](given.depth_mm, model)


if __name__ == "__main__":
    main()
