"""The gel by CalculiX, a finite-element code by others, beside ours: `python -m tests.benchmarks.calculix drag|press`.

Both solve a Neo-Hookean block that is bonded to its support, with a rigid object in contact. CalculiX has other
elements (bricks of 20 nodes), another contact (penalties between surfaces), another friction (a spring that yields),
and a law that differs from ours by terms of the order of the volume's change, about one per cent here. Half of the
block is solved: what is pressed and how it moves is its own mirror image in y = 0. Debian: `apt-get install
calculix-ccx`. Processor time: two minutes for the presses, five for the drags.
"""

import argparse
import re
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator

from gellight.reconstruction.force import Layer, indenting
from sim_reference.deformation import grid
from sim_reference.fem.dragging import Dragged, Pose, drag
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height
from tests.benchmarks.shear_fem import PIXEL_MM, depth_map, felt

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
GEOMETRY = replace(SensorGeometry(), gel_diameter_mm=28.0, coating_smoothing_mm=0.0)
HALF_MM = 12.4
"""of the block's side: as much gel as the disc"""
SPACING_MM = 0.125
AT = grid(256, SPACING_MM)
FINE_MM, GROWTH, REACH_MM = 0.5, 1.6, 2.6
"""bricks where the object touches, how much larger each is than the last beyond, and where that begins"""
OBJECT_MM = 0.15
"""points of the object in CalculiX"""
PENALTY, STICK = 1000.0, 500.0
"""shear moduli per mm: of a gap that is negative, and of what sticks; with a fifth and a tenth the force is 1 % less"""
GEL = FemGel(resolution_mm=0.4, dense_radius_mm=3.0)
FRICTION, DEPTH_MM = 0.4, 0.4
DRAGS_MM = (0.1, 0.2, 0.35)
LATTICES = 12
"""of dots, each lying beside the contact as chance has it"""
JUDGED_MM = 5.0
"""radius around the middle in which surfaces are compared"""


@dataclass(frozen=True, eq=False)
class Block:
    """Half of the gel as bricks of 20 nodes; z = 0 is free, as in `sim_reference.fem`."""

    nodes: Array
    """(N, 3) mm"""
    bricks: Indices
    """(B, 20) nodes, in CalculiX' order"""

    def where(self, axis: int, value: float) -> Indices:
        """Return the nodes of a plane."""
        return np.flatnonzero(self.nodes[:, axis] == value)

    @property
    def touched(self) -> Indices:
        """The bricks of the free surface that the object may come to."""
        corners = self.nodes[self.bricks[:, :8]]
        near = np.hypot(*corners[:, :, :2].mean(axis=1).T) < REACH_MM + 1.0
        return np.flatnonzero(near & (corners[:, :4, 2] == 0).all(axis=1))


def graded(reach: float, end: float) -> Array:
    """Return from 0 to `end` points FINE_MM apart up to `reach`, then further and further apart."""
    points, step = list(np.arange(0, reach + FINE_MM / 2, FINE_MM)), FINE_MM
    while points[-1] + 1.6 * step * GROWTH < end:
        step *= GROWTH
        points.append(points[-1] + step)
    return np.array([*points, end])


def block() -> Block:
    """Return the half block."""
    y = graded(REACH_MM, HALF_MM)
    sides = [np.concatenate([-y[:0:-1], y]), y, graded(FINE_MM, GEOMETRY.gel_thickness_mm)]
    dense = [np.sort(np.concatenate([side, (side[1:] + side[:-1]) / 2])) for side in sides]
    lattice = np.stack(np.meshgrid(*(np.arange(len(each)) for each in dense), indexing="ij"), axis=-1)
    used = (lattice % 2).sum(axis=-1) <= 1
    numbers = np.where(used, np.cumsum(used).reshape(used.shape) - 1, -1)
    first = np.stack(np.meshgrid(*(2 * np.arange(len(side) - 1) for side in sides), indexing="ij"), axis=-1)
    bricks = [numbers[tuple((first.reshape(-1, 3) + offset).T)] for offset in _offsets()]
    nodes = np.stack([dense[axis][lattice[used][:, axis]] for axis in range(3)], axis=1)
    return Block(nodes, np.stack(bricks, axis=1))


def _offsets() -> list[tuple[int, int, int]]:
    """The 20 nodes of a brick: corners below and above, middles of the edges below, above and between."""
    corners, edges = [(0, 0), (2, 0), (2, 2), (0, 2)], [(1, 0), (2, 1), (1, 2), (0, 1)]
    rings = [(corners, 0), (corners, 2), (edges, 0), (edges, 2), (corners, 1)]
    return [(x, y, z) for ring, z in rings for x, y in ring]


def rigid(height: Array) -> tuple[Array, Indices]:
    """Return nodes (M, 3) and bricks (K, 8) of the object, whose far side is half a millimetre behind the near one."""
    x = np.arange(-REACH_MM - 1.2, REACH_MM + 1.2, OBJECT_MM)
    y = np.arange(-2 * OBJECT_MM, REACH_MM + 1.2, OBJECT_MM)
    heights = LinearNDInterpolator(np.stack(np.meshgrid(AT, AT), axis=-1).reshape(-1, 2), height.ravel())
    at = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    near = np.maximum(heights(at), -2.5) - 1e-4
    layers = [np.concatenate([at, (near - behind)[..., None]], axis=-1) for behind in (0.5, 0.0)]
    numbers = np.arange(2 * near.size).reshape(2, *near.shape)
    ring = [(slice(-1), slice(-1)), (slice(1, None), slice(-1)), (slice(1, None), slice(1, None)),
            (slice(-1), slice(1, None))]  # fmt: skip
    bricks = [numbers[layer][corner].ravel() for layer in (0, 1) for corner in ring]
    return np.concatenate([layer.reshape(-1, 3) for layer in layers]), np.stack(bricks, axis=1)


def deck(gel: Block, height: Array, moves: Iterable[tuple[float, float, float]], friction: float) -> str:
    """Return CalculiX' input: the object goes to each of the moves in a step of its own. The shear modulus is 1."""
    nodes, bricks = rigid(height)
    count, elements = len(gel.nodes), len(gel.bricks)
    bulk = 2 * GEOMETRY.poisson_ratio / (1 - 2 * GEOMETRY.poisson_ratio) + 2 / 3
    return "".join([
        "*NODE, NSET=ALL\n", _rows(1, np.concatenate([gel.nodes, nodes])),
        "*ELEMENT, TYPE=C3D20R, ELSET=GEL\n", _rows(1, gel.bricks + 1),
        "*ELEMENT, TYPE=C3D8, ELSET=OBJECT\n", _rows(elements + 1, bricks + 1 + count),
        _set("NSET=SUPPORT", gel.where(2, GEOMETRY.gel_thickness_mm)), _set("NSET=MIRROR", gel.where(1, 0.0)),
        _set("NSET=FREE", gel.where(2, 0.0)), _set("NSET=RIGID", np.arange(count, count + len(nodes))),
        _set("ELSET=TOUCHED", gel.touched), "*SURFACE, NAME=GELSIDE\nTOUCHED, S1\n*SURFACE, NAME=TOOL\nOBJECT, S2\n",
        f"*MATERIAL, NAME=SOFT\n*HYPERELASTIC, NEO HOOKE\n0.5, {2 / bulk}\n*SOLID SECTION, ELSET=GEL, MATERIAL=SOFT\n",
        "*MATERIAL, NAME=HARD\n*ELASTIC\n1000., .3\n*SOLID SECTION, ELSET=OBJECT, MATERIAL=HARD\n",
        f"*SURFACE INTERACTION, NAME=I\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{PENALTY}, .001, .002\n",
        f"*FRICTION\n{friction}, {STICK}\n" if friction else "",
        "*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE\nGELSIDE, TOOL\n",
        "*BOUNDARY\nSUPPORT, 1, 3\nMIRROR, 2, 2\n", *map(_step, moves),
    ])  # fmt: skip


def _step(move: tuple[float, float, float]) -> str:
    held = "".join(f"RIGID, {axis}, {axis}, {by}\n" for axis, by in enumerate(move, 1))
    asked = "*NODE PRINT, NSET=SUPPORT, TOTALS=ONLY\nRF\n*NODE PRINT, NSET=FREE\nU\n"
    return f"*STEP, INC=100, NLGEOM\n*STATIC\n.25, 1., .002, .5\n*BOUNDARY\n{held}{asked}*END STEP\n"


def _rows(first: int, rows: Array | Indices) -> str:
    """Number the rows; a line of CalculiX holds 16 figures."""
    lines = []
    for number, row in enumerate(rows.tolist(), first):
        text = [f"{one:.7g}" for one in (number, *row)]
        lines.append(", ".join(text[:12]) + (",\n" + ", ".join(text[12:]) if len(text) > 12 else ""))
    return "\n".join(lines) + "\n"


def _set(name: str, numbers: Indices) -> str:
    lines = [", ".join(map(str, numbers[at : at + 12] + 1)) for at in range(0, len(numbers), 12)]
    return f"*{name.split('=')[0]}, {name}\n" + ",\n".join(lines) + "\n"


def solved(text: str) -> tuple[list[Array], list[Array]]:
    """Run CalculiX; return the force (3,) of the object on the whole gel and the moves of FREE (S, 3) of each step."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "run.inp").write_text(text)
        program = shutil.which("ccx")
        if program is None:
            raise SystemExit("CalculiX is not here: apt-get install calculix-ccx")
        ended = subprocess.run([program, "run"], cwd=folder, capture_output=True, text=True, timeout=3000)
        lines = Path(folder, "run.dat").read_text().splitlines()
        if "Job finished" not in ended.stdout:
            print(f"CalculiX ended early: {[line for line in ended.stdout.splitlines() if '*ERROR' in line][:1]}")
    forces, moves = {}, {}
    for number, line in enumerate(lines):
        if at := re.search(r"total force .* time +(\S+)", line):
            forces[float(at[1])] = np.array(lines[number + 2].split(), float) * (-2, 0, -2)
        elif at := re.search(r"displacements .* time +(\S+)", line):
            rows = [row.split()[1:] for row in lines[number + 2 : number + 2 + len(FREE)]]
            moves[float(at[1])] = np.array(rows, float)
    ends = [time for time in forces if time == round(time)]
    return [forces[time] for time in ends], [moves[time] for time in ends]


def judge_drags() -> None:
    """Press a ball with friction and drag it; print forces and surfaces of both."""
    ball = object_height("BALL", AT[None, :], AT[:, None])
    path = [Pose(), *(Pose((x, 0.0, 0.0)) for x in DRAGS_MM)]
    begun = spent()
    ours = drag(replace(GEL, friction=FRICTION), ball, SPACING_MM, DEPTH_MM, path, GEOMETRY)
    took = spent() - begun
    moves = [(pose.move_mm[0], 0.0, DEPTH_MM) for pose in path]
    forces, moved = solved(deck(BLOCK, ball, moves, FRICTION))
    for one, force, by in zip(ours, forces, moved, strict=False):
        compare(f"{one.pose.move_mm[0]:.2f} mm", one, force, by)
    judge_dots([(each.surface_mm, each.moved_mm, each.force_n) for each in ours], "our finite elements")
    judge_dots([(*mirrored(by), force) for force, by in zip(forces, moved, strict=True)], "CalculiX")
    print(f"processor time: ours {took:.0f} s, CalculiX {spent() - begun - took:.0f} s")


def mirrored(moved: Array) -> tuple[Array, Array]:
    """Return the points (S, 3) of the whole surface, z down, and how far they moved, of the half that was solved."""
    at = BLOCK.nodes[FREE]
    beyond = at[:, 1] > 0
    rest, moves = (np.concatenate([each, each[beyond] * [1, -1, 1]]) for each in (at, moved))
    return rest + moves, moves


def judge_dots(poses: list[tuple[Array, Array, Array]], whose: str) -> None:
    """Print the force along the gel that dots tell on surfaces, beside the true one; the first pose is the press.

    Young's modulus is from the press alone, as in `tests.benchmarks.shear_fem`.
    """
    layer, random = Layer(GEOMETRY.gel_thickness_mm, GEOMETRY.poisson_ratio), np.random.default_rng(5)
    depth = depth_map(poses[0][0])
    modulus = poses[0][2][2] / indenting(depth, (PIXEL_MM, PIXEL_MM), layer).integral_mm2
    off = []
    for surface, moved, force in poses[1:]:
        told = [felt(surface, moved, modulus, random).force_n for _ in range(LATTICES)]
        shares = np.array([one for one in told if one is not None]) / np.hypot(*force[:2])
        off += list(np.hypot(shares[:, 0] - 1, shares[:, 1]))
        print(
            f"dots on {whose}: Fx {shares[:, 0].mean():.3f} of the true one, from {shares[:, 0].min():.3f} to "
            f"{shares[:, 0].max():.3f}; Fy {shares[:, 1].mean():+.3f}; {LATTICES - len(shares)} of {LATTICES} unknown",
            flush=True,
        )
    print(
        f"dots on {whose}: off by {100 * np.median(off):.1f} % in the median, p90 {100 * np.percentile(off, 90):.1f} %"
    )


def judge_presses() -> None:
    """Press two objects without friction; print forces and heights of both."""
    for name, depth in (("BALL", 0.6), ("SCROWN", 0.5)):
        height = object_height(name, AT[None, :], AT[:, None])
        ours = drag(GEL, height, SPACING_MM, depth, [Pose()], GEOMETRY)[0]
        forces, moved = solved(deck(BLOCK, height, [(0.0, 0.0, depth)], 0.0))
        if forces:
            compare(f"{name}, {depth} mm", ours, forces[-1], moved[-1])


def compare(name: str, ours: Dragged, force: Array, moved: Array) -> None:
    """Print how far both are from one another."""
    mine = ours.force_n / GEL.shear_modulus_mpa(GEOMETRY)
    at = BLOCK.nodes[FREE]
    rest = (ours.surface_mm - ours.moved_mm)[:, :2]
    near = np.hypot(*at[:, :2].T) < JUDGED_MM
    off = LinearNDInterpolator(rest, ours.moved_mm)(at[near, :2]) - moved[near]
    share = [float(np.sqrt((off[:, axes] ** 2).sum() / (moved[near][:, axes] ** 2).sum())) for axes in ([0, 1], [2])]
    deep = LinearNDInterpolator(ours.surface_mm[:, :2], ours.surface_mm[:, 2])((at + moved)[near, :2])
    height = np.abs(deep - moved[near, 2])
    print(
        f"{name}: Fx {mine[0]:.4f}, CalculiX {force[0]:.4f}; Fz {mine[2]:.4f}, {force[2]:.4f} "
        f"({100 * (mine[2] / force[2] - 1):+.1f} %); Fx/Fz {mine[0] / mine[2]:.4f}, {force[0] / force[2]:.4f}; "
        f"moved along the gel, down: {100 * share[0]:.1f}, {100 * share[1]:.1f} % of rms off; height: "
        f"mean {1e3 * height.mean():.1f}, p95 {1e3 * np.percentile(height, 95):.1f}, most {1e3 * height.max():.1f} um",
        flush=True,
    )


def spent() -> float:
    """Return the processor time of this program and of what it ran, s."""
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime for each in both)


def main() -> None:
    """Judge what is asked for."""
    judges = {"drag": judge_drags, "press": judge_presses}
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.calculix", description=__doc__)
    parser.add_argument("what", nargs="*", choices=[*judges, []], default=[*judges])
    for what in parser.parse_args().what:
        judges[what]()


BLOCK = block()
FREE = BLOCK.where(2, 0.0)

if __name__ == "__main__":
    main()
