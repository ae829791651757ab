"""Make the presses of tests/data/fem/presses.npz anew, by finite elements as they are now.

    python -m tests.benchmarks.fem_presses
    python -m tests.benchmarks.fem_presses --only pins_0.4 pins_0.7

Prints each force, its ratio to the one that was there, how the coated surface within 7 mm has changed, and the
processor time of one thread. Each press is written when it is done: means over two by two points of the grid that was
pressed.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim_reference.deformation import NO_OBJECT, grid
from sim_reference.fem.gel import FemGel, coated
from sim_reference.geometry import AS_BUILT
from sim_reference.objects import ObjectParameters, object_height
from tests.helpers.places import CHECKOUT

Array = NDArray[np.float64]
RECORD = CHECKOUT / "tests/data/fem/presses.npz"
SIZE, SPACING_MM, UNIT_MM = 320, 0.125, 1e-4
MODEL, GEOMETRY = FemGel(resolution_mm=0.3, dense_radius_mm=7.0), AS_BUILT
AT = grid(SIZE, SPACING_MM)
X, Y = np.meshgrid(AT, AT)
INSIDE = np.hypot(X, Y)[::2, ::2] < MODEL.dense_radius_mm


def ball(radius_mm: float) -> Array:
    return object_height("BALL", X, Y, ObjectParameters(calibration_ball_radius_mm=radius_mm))


def cylinder() -> Array:
    """On its side, along y."""
    there = (np.abs(X) < 3) & (np.abs(Y) < 4)
    return np.where(there, np.sqrt(np.maximum(9 - X**2, 0)) - 3, NO_OBJECT)


def roof() -> Array:
    """With its edge along y."""
    return np.where(np.abs(Y) < 3, -np.abs(X) * np.tan(np.radians(30)), NO_OBJECT)


def punch() -> Array:
    """Flat within 2.5 mm of its middle, then a bevel of 45 degrees."""
    radius = np.hypot(X, Y)
    return np.where(radius < 2.8, -np.maximum(radius - 2.5, 0), NO_OBJECT)


def pins() -> Array:
    """Hemispheres in three rows of three."""
    off = [c - 3 * np.clip(np.rint(c / 3), -1, 1) for c in (X, Y)]
    radius = np.hypot(*off)
    return np.where(radius < 0.8, np.sqrt(np.maximum(0.64 - radius**2, 0)) - 0.8, NO_OBJECT)


OBJECTS: dict[str, Callable[[], Array]] = {
    "ball2.5": lambda: ball(2.5),
    "ball4": lambda: ball(4.0),
    "ball7": lambda: ball(7.0),
    "cyl": cylinder,
    "pins": pins,
    "prism": roof,
    "punch": punch,
    "tstep": lambda: object_height("TSTEP", X, Y),
}
DEPTHS_MM = {
    "ball2.5": ("0.9",),
    "ball4": ("0.3", "1.0"),
    "ball7": ("0.8",),
    "cyl": ("0.5", "1.0"),
    "pins": ("0.4", "0.7"),
    "prism": ("0.5", "0.9"),
    "punch": ("0.4", "0.8"),
    "tstep": ("0.5",),
}
NAMES = [f"{name}_{depth}" for name, depths in DEPTHS_MM.items() for depth in depths]


def press(name: str) -> dict[str, Array]:
    """Press one, print what has changed, and return its arrays of the record."""
    which, depth = name.split("_")
    begun = time.process_time()
    found = MODEL.press(OBJECTS[which](), SPACING_MM, float(depth), GEOMETRY)
    cpu_s = time.process_time() - begun
    surface = coated(found, SPACING_MM, GEOMETRY).depth_mm.reshape(SIZE // 2, 2, SIZE // 2, 2).mean(axis=(1, 3))
    units = np.rint(surface / UNIT_MM).astype(np.int16)
    with np.load(RECORD) as before:
        changed_um = np.abs(units - before[f"{name}_depth"].astype(float))[INSIDE] * UNIT_MM * 1e3
        ratio = found.force_n / float(before[f"{name}_force_n"])
    print(f"{name:12} {found.force_n:8.4f} N, {ratio:.3f} of before; surface {changed_um.mean():5.2f} um, most "
          f"{changed_um.max():5.1f}; {len(found.steps)} steps, {cpu_s:.1f} s", flush=True)  # fmt: skip
    return {f"{name}_depth": units, f"{name}_force_n": np.array(found.force_n)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=NAMES, choices=NAMES, metavar="NAME")
    for name in parser.parse_args().only:
        made = press(name)
        with np.load(RECORD) as before:
            kept = dict(before)
        np.savez_compressed(RECORD, allow_pickle=False, **(kept | made))


if __name__ == "__main__":
    main()
