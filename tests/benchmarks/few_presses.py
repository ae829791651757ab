"""What is best with few presses: `python -m tests.benchmarks.few_presses [SET ...]`.

Mean angle between felt and true normal inside the circles of presses held out, in the folds of `real_presses`, pixel by
pixel: a cubic in the colours (19 terms), what teaches GelNet of few presses (`gelnet.teacher`: the same with terms of
the place, shrunk), GelNet as it is trained on both, and the mean angle of these two; then GelNet with the presses of
each other unit as a like one's (`--like`), and how unlike it is (refused beyond `teacher.UNLIKE`). At last what another
unit's presses alone teach, without one of this unit.
"""

import argparse
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.lab.training.polynomial import powers_up_to, ridge, terms_of
from gellight.lab.training.presses import Press
from gellight.lab.training.table import TableOptions, build_table, drift_of_presses
from gellight.lab.training.training import HAND_DRAWN
from gellight.reconstruction.integration import angle_deg, normals
from gelnet import teacher
from gelnet.recipes import RECIPES
from gelnet.table import Table
from gelnet.trainers import make_trainer
from gelnet.training import train, unchanged
from tests.benchmarks.real_judging import folds_of
from tests.benchmarks.real_sets import SETS, RealSet

Floats = NDArray[np.float32]
Answer = Callable[[Floats], NDArray[np.floating]]
COUNTS = (1, 2, 5)
FEW = ("mini", "gelslam", "gripper", "digit")
RIDGE = 1e-3
LIMIT_RAD = 1.3


def rows_of(presses: Sequence[Press], images: RealSet, options: TableOptions = HAND_DRAWN) -> Table:
    """Return the labelled pixels of presses."""
    untouched = images.reference.image
    follow = drift_of_presses(images.presses, untouched) > images.reference.noise_grey
    table = build_table(presses, untouched, images.ball, options, follow_light=follow)
    return Table(rows=table.rows, image=table.image, image_size=table.image_size, untouched=untouched)


def cubic(table: Table) -> Answer:
    """Return a cubic in the colours, whose answer to no change is no slope."""
    powers = [power for power in powers_up_to(3, 3) if any(power)]
    colours, angles = table.pixels[:, :3], np.arctan(table.gradient)
    least, most = colours.min(axis=0), colours.max(axis=0)
    size = np.sqrt((terms_of(list(colours.T), powers) ** 2).mean(axis=0))
    weights = ridge(terms_of(list(colours.T), powers) / size, angles, RIDGE)

    def answer(pixels: Floats) -> NDArray[np.floating]:
        seen = np.clip(pixels[:, :3], least, most)
        return np.tan(np.clip(terms_of(list(seen.T), powers) / size @ weights, -LIMIT_RAD, LIMIT_RAD))

    return answer


def ways(table: Table) -> dict[str, Answer]:
    """Return each way, learnt from a table."""
    assert table.untouched is not None
    closed, gelnet = teacher.fit_teacher(table, table.untouched).answer, trained(table)

    def mean(pixels: Floats) -> NDArray[np.floating]:
        return np.tan((np.arctan(gelnet(pixels)) + np.arctan(closed(pixels))) / 2)

    return {"cubic": cubic(table), "teacher": closed, "GelNet": gelnet, "mean of both": mean}


def trained(table: Table) -> Answer:
    """Return GelNet as `fit` trains it on a table."""
    assert table.untouched is not None
    taught = teacher.with_taught(table, table.untouched, np.random.default_rng(0))
    network = train(taught, RECIPES["thorough"], make_trainer("numpy", seed=0), width=32).network
    return lambda pixels: network.answer(pixels) - network.answer(unchanged(pixels))


def error_deg(answer: Answer, table: Table) -> float:
    """Return the mean angle between normals, deg, every press as much as another."""
    felt, true = (slopes.astype(np.float32)[:, None] for slopes in (answer(table.pixels), table.gradient))
    angle = angle_deg(normals(felt), normals(true)).ravel()
    return float(np.mean([angle[table.image == number].mean() for number in np.unique(table.image)]))


def main() -> None:
    """Print a line for each set and number of presses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", choices=[*FEW, []], metavar="SET", help="all where none is named")
    chosen = parser.parse_args().sets or FEW
    sets = {name: SETS[name](Path(tempfile.mkdtemp())) for name in chosen}
    every = {name: rows_of(images.presses, images) for name, images in sets.items()}
    for name, images in sets.items():
        judges = rows_of(images.presses, images, TableOptions(inset_px=0))
        for count in COUNTS:
            found: dict[str, list[float]] = {}
            for fold in folds_of(images, count):
                judging = rows_of(fold.held_out, images, TableOptions(inset_px=0))
                own = rows_of(fold.training, images)
                for way, answer in ways(own).items():
                    found.setdefault(way, []).append(error_deg(answer, judging))
                for other, table in every.items():
                    if other != name and table.image_size == own.image_size and own.untouched is not None:
                        with_like = replace(own, like=as_bright(table, own.untouched))
                        found.setdefault(f"like {other}", []).append(error_deg(trained(with_like), judging))
                        unlike = teacher.unlikeness(with_like, own.untouched)
                        found.setdefault(f"unlike {other}", []).append(unlike)
            print(f"{name}, {count}:", {way: round(float(np.mean(deg)), 2) for way, deg in found.items()}, flush=True)
        for other, table in every.items():
            same = judges.image_size == table.image_size and other != name
            if same and judges.untouched is not None:
                print(f"{name}, {other}'s alone: {error_deg(alike(table, judges.untouched), judges):.2f}", flush=True)


def as_bright(other: Table, untouched: Floats) -> Table:
    """Return another unit's presses, their colours as bright as under this unit's light."""
    x, y = other.rows[:, 3:5].astype(np.intp).T
    dark = teacher.DARKEST_GREY
    rows = other.rows.copy()
    rows[:, :3] *= np.maximum(untouched[y, x], dark) / np.maximum(other.untouched[y, x], dark)
    return Table(rows=rows, image=other.image, image_size=other.image_size, untouched=untouched)


def alike(other: Table, untouched: Floats) -> Answer:
    """Return what another unit's presses teach under this unit's light."""
    return teacher.fit_teacher(as_bright(other, untouched), untouched).answer


if __name__ == "__main__":
    main()
