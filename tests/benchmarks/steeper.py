"""Are slopes steeper than any press felt on real sensors? `python -m tests.benchmarks.steeper [SET...]`.

GelNet learns the flatter six tenths of the slopes of half of the presses, and is asked about the other half: about
slopes that it learnt, and about two steeper parts of equal width. With and without `gelnet.steeper`.
"""

import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.lab.training.table import TableOptions, build_table
from gellight.reconstruction.integration import angle_deg, normals
from gelnet.numpy_trainer import NumpyTrainer
from gelnet.recipes import DEFAULT_WIDTH, RECIPES
from gelnet.steeper import steeper_rows
from gelnet.table import Table
from gelnet.teacher import with_taught
from gelnet.training import train, unchanged
from tests.benchmarks.real_sets import SETS

LEARNT, STEEPEST = 0.6, 0.98
"""of the steepest slope, which is this quantile; beyond it labels lie at the rim of a ball, where few are right"""
SEEDS = 2
NAMES = "gelslam", "gripper", "skleff", "mini", "digit"


def table_of(name: str) -> Table:
    """Return the labelled pixels of a real set."""
    with tempfile.TemporaryDirectory() as folder:
        images = SETS[name](Path(folder))
        reference = images.reference.image
        table = build_table(images.presses, reference, images.ball, TableOptions(rim_share=0.25), follow_light=True)
    return Table(rows=table.rows, image=table.image, image_size=table.image_size, untouched=reference)


def errors_deg(table: Table, learnt_deg: float, steepest_deg: float, seed: int, *, steeper: bool) -> list[float]:
    """Return how much too steep slopes are felt and the error of normals, deg: of each part one after another."""
    assert table.untouched is not None
    random, inclined = np.random.default_rng(seed), _inclined_deg(table.gradient)
    half = np.isin(table.image, random.permutation(table.image.max() + 1)[: (table.image.max() + 1) // 2])
    learnt = table.chosen(half & (inclined < learnt_deg))
    rows = with_taught(learnt, table.untouched, random)
    rows = rows.joined(steeper_rows(learnt, table.untouched, random)) if steeper else rows
    network = train(rows, RECIPES["fast"], NumpyTrainer(seed=seed), width=DEFAULT_WIDTH).network
    asked, true_deg = table.chosen(~half), inclined[~half]
    slopes = network.answer(asked.pixels) - network.answer(unchanged(asked.pixels))
    off_deg = angle_deg(normals(slopes[None])[0], normals(asked.gradient[None])[0])
    edges = [0.0, *np.linspace(learnt_deg, steepest_deg, 3)]
    parts = [(true_deg >= low) & (true_deg < high) for low, high in pairwise(edges)]
    return [float(of[part].mean()) for part in parts for of in (_inclined_deg(slopes) - true_deg, off_deg)]


def _inclined_deg(slopes: NDArray[np.floating]) -> NDArray[np.floating]:
    return np.asarray(np.degrees(np.arctan(np.hypot(*slopes.T))))


def main() -> None:
    """Print two lines for each set."""
    for name in sys.argv[1:] or NAMES:
        table = table_of(name)
        steepest = float(np.quantile(_inclined_deg(table.gradient), STEEPEST))
        for steeper in (False, True):
            runs = [errors_deg(table, LEARNT * steepest, steepest, seed, steeper=steeper) for seed in range(SEEDS)]
            figures = " ".join(f"{value:+.2f}" for value in np.mean(runs, axis=0))
            print(
                f"{name}, learnt to {LEARNT * steepest:.0f} of {steepest:.0f} deg, {steeper = }: {figures}", flush=True
            )


if __name__ == "__main__":
    main()
