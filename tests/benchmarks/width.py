"""How wide GelNet should be: `python -m tests.benchmarks.width PART FOLDER [WIDTH...]`, the parts one after the other.

    table   presses the balls that the shipped network learns from and writes their pixels to the folder
    train   trains networks of each width, two seeds each, as the shipped one is, and writes them to the folder
    judge   prints the errors of each width on simulated presses of balls, of other objects, and on a gel of finite
            elements (a minute a press, once), and its processor time a frame, all widths in turn
    real    trains and judges each width on presses of a real sensor (beside the checkout), in three folds by image

Errors are means over the presses and the seeds, with the standard deviation over the seeds.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.simulator.gel_models import KeptPresses
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.labelling.refinement import refine
from gellight.lab.training.presses import Ball
from gellight.lab.training.table import images_of
from gellight.lab.training.training import Learning, TrainingOptions, fit, read_reference
from gellight.lab.training.validation import press_errors
from gellight.reconstruction.errors import TrueSurface, mean_errors, surface_errors
from gelnet.export import to_onnx
from gelnet.synthetic import SEEDS as TABLE_SEEDS
from gelnet.synthetic import Options, simulated_sensor, table_of_presses
from gelnet.table import Table, load_table
from gelnet.trainers import make_trainer
from gelnet.training import train
from sim_reference.camera import CameraResponse, digitise
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry
from tests.benchmarks.frame_times import scenes
from tests.helpers.places import real

WIDTHS = (16, 24, 32, 48, 64)
SEEDS = (0, 1)
FOLDS, ROUNDS = 3, 15
NOISE_GREY = 1.0
REAL = real("gelsight_mini_ball")
REAL_BALL = Ball(radius_mm=2.35, pixel_size_mm=0.05107)
PLACES_MM = ((0.0, 0.0), (6.5, -3.0), (-8.0, 5.0))
PRESSES = {
    "ball, 1 mm": [Press("BALL", 1.0, *place) for place in PLACES_MM],
    "ball, 1.9 mm": [Press("BALL", 1.9, *place) for place in PLACES_MM[:2]],
    "other objects": [Press(name, 0.8) for name in ("TSTEP", "CCONVEX", "SINWAVE")],
}
FEM_PRESSES = [Press("BALL", 0.6), Press("BALL", 1.0, *PLACES_MM[1]), Press("BALL", 0.3, -4.0, 2.0)]
FEM = KeptPresses(FemGel(resolution_mm=0.3, dense_radius_mm=7.0))


def make_table(folder: Path, widths: tuple[int, ...]) -> None:
    """Write what the shipped network learns from."""
    options, sensor = Options(), simulated_sensor(SensorGeometry(), seed=0)
    seed = TABLE_SEEDS["training"]
    table = table_of_presses(sensor, options, count=options.presses, noise_grey=None, seed=seed)
    np.savez(folder / "table.npz", rows=table.rows, image=table.image, image_size=np.array(table.image_size))


def train_widths(folder: Path, widths: tuple[int, ...]) -> None:
    """Write the networks; those that are there stay."""
    table = load_table(folder / "table.npz")
    for width in widths:
        for seed in SEEDS:
            path = folder / f"{width}-{seed}.onnx"
            if not path.exists():
                path.write_bytes(trained(table, width, seed))


def trained(table: Table, width: int, seed: int) -> bytes:
    """Return a network, trained as the shipped one."""
    training = train(table, Options().how(), make_trainer("numpy", seed=seed), width=width)
    print(f"width {width}, seed {seed}: loss {training.losses[-1]:.5f}, {training.cpu_seconds:.0f} CPU s", flush=True)
    return to_onnx(training.network.parameters(), {})


def judge(folder: Path, widths: tuple[int, ...]) -> None:
    """Print a row a width."""
    shipped = load_bundle("synthetic")
    bundles = {width: [with_network(shipped, folder / f"{width}-{seed}.onnx") for seed in SEEDS] for width in widths}
    taken = {name: pictures(Scene(SensorGeometry(), CameraResponse(noise_grey=NOISE_GREY)), presses)
             for name, presses in PRESSES.items()}  # fmt: skip
    taken["finite elements"] = pictures(
        Scene(SensorGeometry(), CameraResponse(noise_grey=NOISE_GREY), model=FEM), FEM_PRESSES
    )
    times = frame_times({width: seeds[0] for width, seeds in bundles.items()})
    print("width | " + " | ".join(f"{name}: deg in contact, um" for name in taken) + " | ms on " + ", ".join(times))
    for width, seeds in bundles.items():
        errors = " | ".join(errors_of(seeds, frames) for frames in taken.values())
        print(f"{width} | {errors} | " + ", ".join(f"{of[width] * 1e3:.1f}" for of in times.values()), flush=True)


def with_network(bundle: Bundle, path: Path) -> Bundle:
    """Return a bundle with another network."""
    return replace(bundle, files={**bundle.files, bundle.manifest.network: path.read_bytes()})


Picture = tuple[CameraFrame, TrueSurface]


def pictures(scene: Scene, presses: list[Press]) -> list[Picture]:
    """Return a noisy frame of each press, and the true surface."""
    random = np.random.default_rng(7)
    shown = [scene.show(press) for press in presses]
    return [
        (CameraFrame(image=digitise(grey, NOISE_GREY, random), time_s=0.0, sequence=0), true) for grey, true in shown
    ]


def errors_of(bundles: list[Bundle], frames: list[Picture]) -> str:
    """Return the errors in contact, mean and spread over networks of several seeds."""
    found = []
    for bundle in bundles:
        reconstructor = Reconstructor(bundle)
        errors = mean_errors([surface_errors(reconstructor.reconstruct(frame), true) for frame, true in frames])
        found.append((errors.contact_normal_deg, errors.contact_depth_mm * 1e3))
    return spread(np.array(found))


def spread(found: np.ndarray) -> str:
    """Return mean and standard deviation of each column."""
    return ", ".join(
        f"{mean:.3f} +- {of:.3f}" for mean, of in zip(found.mean(axis=0), found.std(axis=0, ddof=1), strict=True)
    )


def frame_times(bundles: dict[int, Bundle]) -> dict[str, dict[int, float]]:
    """Return the least processor time of a frame of some scenes by width; the widths take turns."""
    paths = {width: Reconstructor(bundle) for width, bundle in bundles.items()}
    times = {}
    for name, image in scenes(next(iter(bundles.values()))).items():
        frame = CameraFrame(image=image, time_s=0.0, sequence=0)
        runs = {width: partial(path.reconstruct, frame) for width, path in paths.items()}
        rounds = [{width: cpu_s(run) for width, run in runs.items()} for _ in range(ROUNDS)]
        times[name] = {width: min(one[width] for one in rounds) for width in runs}
    return times


def cpu_s(run: Callable[[], object]) -> float:
    """Return the processor time of one run."""
    begun = time.process_time()
    run()
    return time.process_time() - begun


def judge_real(folder: Path, widths: tuple[int, ...]) -> None:
    """Print the error of each width on presses of a real sensor that were not learnt from, by refined labels."""
    reference = read_reference(REAL / "background.png")
    given = read_presses(REAL / "presses.csv", ball=REAL_BALL, image_shape=reference.image_shape)
    presses = refine(given, reference.image, REAL_BALL).presses
    numbers = images_of(presses)
    for width in widths:
        found = []
        for seed in SEEDS:
            how = Learning(options=TrainingOptions(recipe="fast", width=width, seed=seed, trainer="numpy"))
            errors = []
            for fold in range(FOLDS):
                learnt = [press for press, number in zip(presses, numbers, strict=True) if number % FOLDS != fold]
                held_out = [press for press, number in zip(presses, numbers, strict=True) if number % FOLDS == fold]
                with tempfile.TemporaryDirectory() as place:
                    bundle = fit(learnt, reference, REAL_BALL, Path(place) / "bundle", sensor="real", how=how)
                    errors += press_errors(bundle, held_out, REAL_BALL)
            found.append((np.mean([e.mean_deg for e in errors]), 1e3 * np.mean([e.depth_mae_mm for e in errors])))
        print(f"width {width}: {spread(np.array(found))} deg, um", flush=True)


PARTS = {"table": make_table, "train": train_widths, "judge": judge, "real": judge_real}


def main() -> None:
    """Run one part."""
    folder = Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    PARTS[sys.argv[1]](folder, tuple(map(int, sys.argv[3:])) or WIDTHS)


if __name__ == "__main__":
    main()
