"""Train GelNet on a table of labelled pixels: `python -m gelnet.train --trainer numpy --table TABLE.npz --out DIR`.

Writes DIR/network.onnx and DIR/training.json, both or neither, and one JSON object a line on stdout as it goes.
A table that cannot be learnt from is refused with one line on stderr and exit status 2.
"""

import argparse
import os
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gelnet.export import ExportError
from gelnet.lit import Lights, judged, lit_rows
from gelnet.recipes import DEFAULT_WIDTH, RECIPES, Recipe
from gelnet.steeper import steeper_rows
from gelnet.table import Table, TableError, load_table
from gelnet.teacher import UNLIKE, unlikeness, with_taught
from gelnet.trainers import GPU, NAMES, make_trainer
from gelnet.training import print_progress, record_of, train, write


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Train as the command line asks, write the two files, and return the content of training.json."""
    table = load_table(options.table)
    recipe = RECIPES[options.recipe]
    if options.epochs:
        recipe = replace(recipe, epochs=options.epochs, least_visits=0)
    trainer = make_trainer(options.trainer, seed=options.seed, threads=options.threads)
    unlike = _unlikeness(table, recipe, options.recipe)
    lights = judged(table) if table.lit is not None and recipe.place_jitter else None
    rows, how = _taught(table, recipe, options.seed, lights)
    trained = train(rows, how, trainer, width=options.width, progress=print_progress)
    record = record_of(options.recipe, recipe, options.width, options.seed, trained, table)
    record |= {} if unlike is None else {"unlikeness": round(unlike, 3)}
    record |= {"lights": lights.record()} if lights else {}
    write(trained.network, record, table, options.out)
    return record


def _taught(table: Table, recipe: Recipe, seed: int, lights: Lights | None = None) -> tuple[Table, Recipe]:
    """Add what presses lack, in the place of jitter: what the lights show; or else what the presses say of it.

    These say something of places where nothing was pressed, and of slopes steeper than theirs.
    """
    if table.untouched is None or not recipe.place_jitter:
        return table, recipe
    how = replace(recipe, place_jitter=0.0)
    if lights and lights.believed:
        return table.joined(lit_rows(table, corrected=lights.corrected)), how
    taught = with_taught(table, table.untouched, np.random.default_rng(seed))
    return taught.joined(steeper_rows(table, table.untouched, np.random.default_rng(seed))), how


def _unlikeness(table: Table, recipe: Recipe, name: str) -> float | None:
    """Return how unlike the like unit is, None without one; TableError where it is of no use."""
    if table.like is None or table.untouched is None:
        return None
    if not recipe.place_jitter:
        raise TableError(f"recipe {name} learns from the pixels of its own presses alone: learn without a like unit")
    unlike = unlikeness(table, table.untouched)
    if unlike > UNLIKE:
        raise TableError(
            f"what the like unit's presses teach is off by {unlike:.2f} of the slopes of these presses, {UNLIKE} at "
            "most would help: it is no like unit, so learn without it"
        )
    return unlike


def add_training_options(parser: argparse.ArgumentParser) -> None:
    """Add what every training asks for."""
    parser.add_argument("--out", type=Path, required=True, help="folder for the files")
    parser.add_argument("--trainer", choices=(*NAMES, GPU), required=True, help="what computes")
    parser.add_argument("--width", type=int, default=DEFAULT_WIDTH, help="units in each hidden layer")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1, help="of torch; NumPy's are OMP_NUM_THREADS")
    parser.add_argument("--attached", action=Attached, nargs=0, help="end when standard input is closed")


class Attached(argparse.Action):
    """Ends the process when the program that started it, and holds its standard input, is gone."""

    def __call__(self, *_: object) -> None:
        """Let a thread wait for that."""
        threading.Thread(target=self._wait, name="attached", daemon=True).start()

    def _wait(self) -> None:
        while os.read(sys.stdin.fileno(), 1):
            pass
        os._exit(1)


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
