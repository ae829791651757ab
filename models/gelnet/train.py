"""Train GelNet on a table of labelled pixels: `python -m gelnet.train --trainer numpy --table TABLE.npz --out DIR`.

Writes DIR/network.onnx and DIR/training.json, both or neither, and one JSON object a line on stdout as it goes.
A table that cannot be learnt from is refused with one line on stderr and exit status 2.
"""

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gelnet.export import ExportError
from gelnet.recipes import DEFAULT_WIDTH, HELD_OUT, RECIPES, Recipe
from gelnet.table import Table, TableError, load_table, split_by_image
from gelnet.teacher import with_taught
from gelnet.trainers import NAMES, make_trainer
from gelnet.training import Training, judgement, print_progress, record_of, train, write


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Train as the command line asks, write the two files, and return the content of training.json.

    The error is that of a network which did not learn from the images that judge it; the network that is kept is then
    trained in the same way on every image, for a press that was never learnt from is lost to the sensor. With
    `unjudged` only that one is trained.
    """
    table = load_table(options.table)
    recipe = RECIPES[options.recipe]
    if options.epochs:
        recipe = replace(recipe, epochs=options.epochs, least_visits=0)

    parts = 1 if options.unjudged else 2

    def trained_on(rows: Table, part: int) -> Training:
        trainer = make_trainer(options.trainer, seed=options.seed, threads=options.threads)
        rows, how = _taught(rows, recipe, options.seed)
        return train(rows, how, trainer, width=options.width, progress=partial(_print_part, part, parts))

    verdict = {}
    if not options.unjudged:
        training, held_out = split_by_image(table, fraction=HELD_OUT, seed=options.seed)
        verdict = judgement(trained_on(training, 0), held_out)
    kept = trained_on(table, parts - 1)
    record = record_of(options.recipe, recipe, options.width, options.seed, kept, table) | verdict
    write(kept.network, record, table, options.out)
    return record


def _taught(table: Table, recipe: Recipe, seed: int) -> tuple[Table, Recipe]:
    """Add what a teacher says of places where nothing was pressed, in the place of jitter, where the light is known."""
    if table.untouched is None or not recipe.place_jitter:
        return table, recipe
    taught = with_taught(table, table.untouched, np.random.default_rng(seed))
    return taught, replace(recipe, place_jitter=0.0)


def _print_part(part: int, parts: int, epoch: int, epochs: int, loss: float) -> None:
    """Say how far all the trainings are, of which this is number `part`."""
    print_progress(part * epochs + epoch, parts * epochs, loss)


def add_training_options(parser: argparse.ArgumentParser) -> None:
    """Add what every training asks for."""
    parser.add_argument("--out", type=Path, required=True, help="folder for the files")
    parser.add_argument("--trainer", choices=NAMES, required=True, help="what computes")
    parser.add_argument("--width", type=int, default=DEFAULT_WIDTH, help="units in each hidden layer")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1, help="of torch; NumPy's are OMP_NUM_THREADS")


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m gelnet.train", description="Train GelNet on a table of presses.")
    parser.add_argument(
        "--table",
        type=Path,
        required=True,
        help="npz with rows (N, C + 4), image (N,), image_size (2,), and untouched (H, W, 3) where it is known",
    )
    add_training_options(parser)
    parser.add_argument("--recipe", choices=sorted(RECIPES), default="fast")
    parser.add_argument("--epochs", type=int, help="instead of the recipe's number")
    parser.add_argument("--unjudged", action="store_true", help="train no second network on nine tenths to be judged")
    options = parser.parse_args(arguments)
    for name in ("width", "threads"):
        if getattr(options, name) < 1:
            parser.error(f"--{name} {getattr(options, name)}: give at least 1")
    if options.epochs is not None and options.epochs < 1:
        parser.error(f"--epochs {options.epochs}: give at least 1")
    return options


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options = _arguments(arguments)
    try:
        run(options)
    except (TableError, ExportError, OSError) as error:
        print(f"gelnet.train: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
