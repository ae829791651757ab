"""GelNet taught and judged on either gel: `python -m tests.benchmarks.gelnet_on_fem PART FOLDER`, parts in this order.

    table   presses as many balls into the layer as into the gel of finite elements, and writes what a network learns
            from; `table-layer` and `table-fem` make one of them
    train   trains networks on the layer, on finite elements and on both, two seeds each, as the shipped one is
    judge   prints the errors of the shipped network and of every NAME-SEED.onnx in the folder, these and what else was
            put there, on presses into the layer and into finite elements

The judging presses of either gel are balls at four depths and the benchmark objects; those in finite elements are the
recorded ones of tests/data/fem. Errors are means over presses and seeds, with the standard deviation over the seeds.
A ball in finite elements (0.6 mm between vertices) takes some 4 s of processor time, once: presses are kept.
"""

import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.simulator.gel_models import KeptPresses
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.synthetic import ball_presses
from gellight.reconstruction.errors import SurfaceErrors, mean_errors, surface_errors
from gelnet.recipes import DEFAULT_WIDTH
from gelnet.synthetic import SEEDS as TABLE_SEEDS
from gelnet.synthetic import Options, simulated_sensor, table_of_presses
from gelnet.table import Table, checked, load_table
from sim_reference import gel
from sim_reference.camera import CameraResponse
from sim_reference.deformation import Deformation, GelModel
from sim_reference.fem.gel import FemGel
from tests.benchmarks.gel import GEOMETRY, RECORD, RECORDED, SPACING, UNIT_MM, heights
from tests.benchmarks.photometric import object_presses
from tests.benchmarks.width import NOISE_GREY, Picture, pictures, spread, trained, with_network

OPTIONS = Options(presses=80, places=4, rows_per_press=1562)
"""as many rows as the shipped network learns from, of fewer balls: a press takes seconds"""
MODELS: dict[str, GelModel] = {"layer": gel.press, "fem": KeptPresses(FemGel(resolution_mm=0.6, dense_radius_mm=9.0))}
LEARNT_ON = {"layer": ("layer",), "fem": ("fem",), "both": ("layer", "fem")}
SEEDS = (0, 1)
BALLS_AT_DEPTHS = 6
DEPTHS_MM = (0.5, 1.0, 1.5, 2.0)
OBJECTS_DEPTH_MM = 0.9
BEYOND = 30
"""points around a recorded surface, over which it falls to 0: it ends at 17.5 mm, the view at 18.8 mm"""
SEED = 17


def make_table(folder: Path, kind: str) -> None:
    """Press into one gel and write the table."""
    sensor = simulated_sensor(GEOMETRY, seed=0)
    table = table_of_presses(
        sensor, OPTIONS, count=OPTIONS.presses, noise_grey=None,
        seed=TABLE_SEEDS["training"], model=MODELS[kind],
    )  # fmt: skip
    np.savez(folder / f"{kind}.npz", rows=table.rows, image=table.image, image_size=np.array(table.image_size))


def make_tables(folder: Path) -> None:
    """Write both tables."""
    for kind in MODELS:
        make_table(folder, kind)


def train_all(folder: Path) -> None:
    """Write the networks; those that are there stay."""
    tables = {kind: load_table(folder / f"{kind}.npz") for kind in MODELS}
    for seed, (name, kinds) in product(SEEDS, LEARNT_ON.items()):
        path = folder / f"{name}-{seed}.onnx"
        if not path.exists():
            path.write_bytes(trained(joined([tables[kind] for kind in kinds]), DEFAULT_WIDTH, seed))


def joined(tables: list[Table]) -> Table:
    """Return every table's rows as one; each image keeps a number of its own."""
    first = np.cumsum([0, *(table.image.max() + 1 for table in tables)])
    image = np.concatenate([table.image + start for table, start in zip(tables, first, strict=False)])
    rows = np.concatenate([table.rows for table in tables])
    return checked(rows, image.astype(np.int32), np.array(tables[0].image_size))


def judge(folder: Path) -> None:
    """Print a row a name."""
    shipped = load_bundle("synthetic")
    judged = {"shipped": [shipped]}
    for path in sorted(folder.glob("*-*.onnx")):
        judged.setdefault(path.stem.rpartition("-")[0], []).append(with_network(shipped, path))
    taken = judging_pictures()
    print("| learnt on | " + " | ".join(f"{name}: deg, um in contact" for name in taken) + " |")
    for name, bundles in judged.items():
        errors = [[errors_of(bundle, seen) for bundle in bundles] for seen in taken.values()]
        print(f"| {name} | " + " | ".join(map(shown, errors)) + " |", flush=True)


def judging_pictures() -> dict[str, list[Picture]]:
    """Return pictures of balls and objects in either gel, by what they show."""
    taken = {}
    for kind, model in MODELS.items():
        random = np.random.default_rng(SEED)
        scene = Scene(GEOMETRY, CameraResponse(noise_grey=NOISE_GREY), model=model)
        for depth in DEPTHS_MM:
            presses = list(ball_presses(GEOMETRY, BALLS_AT_DEPTHS, random, depth))
            taken[f"{kind}, ball {depth:g} mm"] = pictures(scene, presses)
        taken[f"{kind}, objects"] = pictures(scene, object_presses(random)) if kind == "layer" else recorded_objects()
    return taken


def recorded_objects() -> list[Picture]:
    """Return a picture of each recorded object but the ball, in the middle of the view."""
    with np.load(RECORD) as kept:
        surfaces = {name: kept[name] * UNIT_MM for name in kept.files if name != "BALL"}
    return [picture_of(name, surface) for name, surface in surfaces.items()]


def picture_of(name: str, recorded_mm: np.ndarray) -> Picture:
    """Return a picture of a recorded surface; in contact is what touches where the layer is pressed so."""
    touching = gel.press(heights(name), SPACING, OBJECTS_DEPTH_MM, GEOMETRY).contact[RECORDED]
    depth = np.pad(recorded_mm, BEYOND, mode="linear_ramp")
    surface = Deformation(depth, np.pad(touching, BEYOND).astype(float), 4 * SPACING)
    scene = Scene(GEOMETRY, CameraResponse(noise_grey=NOISE_GREY), model=lambda *_: surface)
    return pictures(scene, [Press(name, OBJECTS_DEPTH_MM)])[0]


def errors_of(bundle: Bundle, seen: list[Picture]) -> SurfaceErrors:
    """Return the mean errors of one network."""
    reconstructor = Reconstructor(bundle)
    return mean_errors([surface_errors(reconstructor.reconstruct(frame), true) for frame, true in seen])


def shown(errors: list[SurfaceErrors]) -> str:
    """Return the errors in contact, with their spread where there are several seeds."""
    found = np.array([(one.contact_normal_deg, 1e3 * one.contact_depth_mm) for one in errors])
    return spread(found) if len(found) > 1 else "{:.3f}, {:.3f}".format(*found[0])


PARTS: dict[str, Callable[[Path], None]] = {
    "table": make_tables,
    "table-layer": lambda folder: make_table(folder, "layer"),
    "table-fem": lambda folder: make_table(folder, "fem"),
    "train": train_all,
    "judge": judge,
}


def main() -> None:
    """Run one part."""
    folder = Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    PARTS[sys.argv[1]](folder)


if __name__ == "__main__":
    main()
