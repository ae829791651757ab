"""Errors on real presses, beside gs_sdk's method: `python -m tests.benchmarks.real_presses [--only TEXT ...]`.

A row is a set, what was held out, how many presses were trained on, whose circles, and the way:

folds       the images are divided, and whatever is judged was not trained on; few presses are drawn at random in each
            fold; `first fold` is one of them: `make test` repeats some, and `--only "first fold" --seeds 5` shows
            how far networks of other seeds are apart
halves      the images are divided in two, and the recipe is `fast`: what `--refine` is worth
hand, own   circles that a person drew, and those that `detect` finds; those by hand judge where there are some
refined     circles that a person drew are moved first to where the pictures show them, as `fit --refine` does

`real_judging` says what the figures mean. Each row that was measured is kept at once in tests/data/real_presses.json,
a seed at a time, so a run can be ended and begun again; what is there is not measured again. Without arguments the
table is printed as it is recorded.
"""

import argparse
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from gellight.lab.training.training import TrainingOptions
from tests.benchmarks.real_judging import (
    GIVEN,
    PLAIN,
    REFINED,
    REFINING,
    WAYS,
    Errors,
    Fold,
    Judges,
    folds_of,
    judged,
    learnt,
    means,
)
from tests.benchmarks.real_record import Measured, Record
from tests.benchmarks.real_sets import HAND, OWN, SETS, RealSet
from tests.helpers.places import is_here

COUNTS = (None, 2, 5, 1, 10, 20)
"""presses trained on; None: all"""
FOLDS, FIRST, HALVES = "folds", "first fold", "halves"
DRAWN = {"mini": (HAND, OWN), "gripper": (HAND, OWN), "gelslam": (OWN,), "digit": (OWN,), "dots": (OWN,),
         "skleff": (HAND, OWN), "objectfolder": (OWN,),
         "three_lights": (HAND,), "three_lights_crop": (HAND,)}  # fmt: skip
"""whose circles there are"""
LEAST_TRAINED = {"three_lights": 21, "three_lights_crop": 9, "dots": 9, "digit": 27, "mini": 26, "gelslam": 35,
                 "gripper": 40, "skleff": 20, "objectfolder": 37}  # fmt: skip
"""presses that a fold has to train on"""
GATE = (("three_lights_crop", HAND, PLAIN), ("mini", HAND, PLAIN))
"""sets, circles and ways of the rows that `make test` repeats"""
SCATTER = tuple((name, count) for name in ("mini", "gripper") for count in (None, 5))
"""sets and numbers of presses whose spread over seeds is looked at, in one fold, by circles of a hand"""


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    set: str
    held_out: str
    presses: int | None
    circles: str
    way: str

    def __str__(self) -> str:
        """Return its name in the record."""
        return " | ".join((self.set, self.held_out, str(self.presses or "all"), self.circles, self.way))

    @property
    def judges(self) -> tuple[str, ...]:
        """Who judges: circles drawn by hand, also where pictures show them; but where only `make test` asks."""
        return (GIVEN, REFINED) if HAND in DRAWN[self.set] and self.held_out != FIRST else (GIVEN,)


def rows() -> list[Row]:
    """Return all rows: one fold first, where `make test` and the spread of seeds need it; then by number of presses."""
    found = [Row(name, FIRST, None, circles, way) for name, circles, way in GATE]
    found += [row for name, count in SCATTER if (row := Row(name, FIRST, count, HAND, PLAIN)) not in found]
    found += [Row(name, HALVES, None, HAND, way) for name in SETS if HAND in DRAWN[name] for way in (PLAIN, REFINING)]
    for count in COUNTS:
        for name in SETS:
            found += [
                Row(name, FOLDS, count, circles, way)
                for circles in DRAWN[name]
                for way in WAYS
                if (count is None or count < LEAST_TRAINED[name]) and (way != REFINING or circles == HAND)
            ]
    return found


@cache
def _images(name: str) -> RealSet:
    return SETS[name](Path(tempfile.mkdtemp(prefix="gellight-real-")))


def measure(row: Row, seed: int) -> tuple[Measured, int]:
    """Train and judge one row with one seed; returns mean errors by judge, and how many presses judged."""
    images, recipe = _images(row.set), "fast" if row.held_out == HALVES else "thorough"
    options = TrainingOptions(recipe=recipe, seed=seed)
    found: dict[str, list[Errors]] = {by: [] for by in row.judges}
    for fold in _folds(row, images):
        felt = learnt(fold.refined if row.way == REFINING else fold.training, images, row.way, options)
        for by, errors in judged(felt, images, _judges(row, fold)).items():
            found[by] += errors
    return {by: means(errors) for by, errors in found.items()}, len(found[GIVEN])


def _folds(row: Row, images: RealSet) -> Iterator[Fold]:
    if row.held_out == FIRST:
        yield next(folds_of(images, row.presses, row.circles))
    if row.held_out == HALVES:
        yield from folds_of(replace(images, folds=2), circles=row.circles)
    if row.held_out == FOLDS:
        yield from folds_of(images, row.presses, row.circles)


def _judges(row: Row, fold: Fold) -> Judges:
    return fold.judges if REFINED in row.judges else {GIVEN: fold.held_out}


def show(chosen: Sequence[Row], record: Record) -> None:
    """Print the rows as they are recorded: means over presses and seeds, the seeds' spread of normals and depth."""
    width = max(len(str(row)) for row in chosen)
    heads = f"{'normals':>9}{'spread':>8}{'< 0.8 r':>9}{'depth mm':>10}{'spread':>9}{'scale':>8}{'seeds':>7}"
    print(f"{'':{width}} {'judged by':10}{heads}")
    for row in chosen:
        known = record.rows.get(str(row))
        if known is None:
            print(f"{row!s:{width}} {'not run' if has_pictures(row) else 'not run, and its pictures are not here'}")
            continue
        for by in row.judges if known.figures(REFINED, "scale") else (GIVEN,):
            deg, sure, depth, scale = (known.figures(by, what) for what in Errors.__dataclass_fields__)
            spread, scatter = (f"{statistics.stdev(x):.{n}f}" if len(x) > 1 else "" for x, n in ((deg, 2), (depth, 4)))
            print(
                f"{row!s:{width}} {by:10}{statistics.mean(deg):9.2f}{spread:>8}{statistics.mean(sure):9.2f}"
                f"{statistics.mean(depth):10.4f}{scatter:>9}{statistics.mean(scale):8.3f}{len(deg):7}"
            )


PICTURES = {
    "mini": "gelsight_mini_ball", "gelslam": "gelslam_ball", "gripper": "gripper_ball", "digit": "digit_ball",
    "skleff": "skleff_mini_ball", "objectfolder": "objectfolder_ball",
    "dots": "dots", "three_lights": "oem_six_lights",
}  # fmt: skip
"""folder of each set; the crop comes along"""


def has_pictures(row: Row) -> bool:
    """Say whether the pictures of a row are on this computer."""
    return row.set not in PICTURES or is_here(PICTURES[row.set])


def main() -> None:
    """Measure what is not recorded, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="TEXT", help="rows whose name holds all of these; measures them")
    parser.add_argument("--all", action="store_true", help="measure all rows: some hours")
    parser.add_argument("--seeds", type=int, default=1, help="networks of each row")
    parser.add_argument("--again", action="store_true", help="measure also what is recorded, and replace it")
    given = parser.parse_args()
    record, texts = Record(), given.only or []
    chosen = [row for row in rows() if all(text in str(row) for text in texts)]
    if not chosen:
        parser.error(f"no row has {' and '.join(texts)} in its name: call it without arguments to see all")
    for row in chosen if given.only or given.all else []:
        if given.again:
            record.forget(str(row))
        for seed in range(given.seeds):
            if has_pictures(row) and not record.has(str(row), seed):
                measured, presses = measure(row, seed)
                record.add(str(row), seed, measured, presses)
                print(f"{row}, seed {seed}: {measured[GIVEN]}", flush=True)
    show(chosen, record)


if __name__ == "__main__":
    main()
