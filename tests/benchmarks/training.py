"""NumPy against PyTorch: `python -m tests.benchmarks.training [presses] [seeds]`.

Both train on the same simulated presses, by turns, as the product does it: in a child process, one thread. Then their
files are judged on the same fresh presses. Times are ratios of one run; the spread of the errors is that of the seeds.
"""

import sys
import time
from statistics import mean, stdev

import numpy as np
import onnxruntime

from gellight.lab.training.table import PressTable
from gellight.lab.training.trainer import TrainerName
from gellight.lab.training.training import TrainingOptions, train
from gelnet.synthetic import Options, Sensor, simulated_sensor, table_of_presses
from gelnet.training import unchanged
from sim_reference.geometry import SensorGeometry

NAMES: tuple[TrainerName, TrainerName] = ("torch", "numpy")
RECIPES = ("fast", "thorough")
ROWS_PER_PRESS = 5500
"""as the routine takes from a press on average"""


def table(sensor: Sensor, presses: int, seed: int) -> PressTable:
    """Presses with the noise of a camera."""
    options = Options(rows_per_press=ROWS_PER_PRESS, contact_share=0.5, flat_share=0.5, other_share=0.0)
    made = table_of_presses(sensor, options, count=presses, noise_grey=sensor.response.noise_grey, seed=seed)
    return PressTable(rows=made.rows, image=made.image, image_size=made.image_size)


def error_deg(network: bytes, test: PressTable) -> float:
    """Mean angle between the normals of a file and the true ones, each pixel alone."""
    session = onnxruntime.InferenceSession(network, providers=["CPUExecutionProvider"])
    pixels = test.rows[:, :5].copy()
    change, rest = (session.run(None, {"pixels": rows})[0] for rows in (pixels, unchanged(pixels)))
    found, wanted = (np.insert(-slopes.astype(float), 2, 1.0, axis=1) for slopes in (change - rest, test.rows[:, 5:]))
    across, along = np.linalg.norm(np.cross(found, wanted), axis=1), (found * wanted).sum(axis=1)
    return float(np.degrees(np.arctan2(across, along)).mean())


def compare(recipe: str, learnt: PressTable, test: PressTable, seeds: int) -> None:
    """Print a line a trainer, and the ratios."""
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in NAMES}
    errors: dict[str, list[float]] = {name: [] for name in NAMES}
    for seed in range(seeds):
        for name in NAMES:
            begun = time.perf_counter()
            network, record = train(learnt, TrainingOptions(recipe=recipe, seed=seed, trainer=name))
            seconds[name].append((float(str(record["cpu_seconds"])), time.perf_counter() - begun))
            errors[name].append(error_deg(network, test))
    cpu, wall = ({name: min(each[i] for each in seconds[name]) for name in NAMES} for i in (0, 1))
    for name in NAMES:
        spread = f"{mean(errors[name]):.3f} +- {stdev(errors[name]):.3f} deg"
        print(f"{recipe:9} {name:6} training {cpu[name]:6.2f} CPU s, whole child {wall[name]:6.2f} s; fresh: {spread}")
    ratios = " and ".join(f"{figure['numpy'] / figure['torch']:.2f}" for figure in (cpu, wall))
    print(f"{recipe:9} numpy takes {ratios} of torch's training and whole child")


def main() -> None:
    """Compare the recipes of the product."""
    presses, seeds = (int(sys.argv[i]) if len(sys.argv) > i else default for i, default in ((1, 40), (2, 3)))
    sensor = simulated_sensor(SensorGeometry(), seed=0)
    learnt, test = table(sensor, presses, seed=11), table(sensor, presses // 4, seed=12)
    print(f"{len(learnt.rows)} rows of {presses} presses, judged on {len(test.rows)} rows of {presses // 4} others")
    for recipe in RECIPES:
        compare(recipe, learnt, test, seeds)


if __name__ == "__main__":
    main()
