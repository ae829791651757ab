"""Wrong labels that are named, on real presses: `python -m tests.benchmarks.wrong_labels [SET ...]`.

In each draw one label in twenty is moved by 0.3 to 3 of its radii, to where its centre is still in the picture, until
every label of the set was moved once. Printed are the share of moved ones that are named, and of the others.
"""

import argparse
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from gellight.base.errors import InputError
from gellight.lab.training import wrong_labels
from gellight.lab.training.presses import Press
from tests.benchmarks.real_sets import SETS, RealSet

ONE_IN = 20
NEAREST, FARTHEST = 0.3, 3.0
"""in contact radii: how far labels are moved"""


@dataclass
class Counted:
    moved: int = 0
    moved_named: int = 0
    right: int = 0
    right_named: int = 0

    def __str__(self) -> str:
        return f"named {self.moved_named} of {self.moved} moved, {self.right_named} of {self.right} right"


def moved(press: Press, images: RealSet, random: np.random.Generator) -> Press:
    """Return the press with its label moved, its centre still in the picture."""
    height, width = images.reference.image_shape
    while True:
        share, angle = random.uniform(NEAREST, FARTHEST), random.uniform(0, 2 * np.pi)
        x = press.center_x_px + share * press.contact_radius_px * np.cos(angle)
        y = press.center_y_px + share * press.contact_radius_px * np.sin(angle)
        if 0 <= x < width and 0 <= y < height:
            return replace(press, center_x_px=float(x), center_y_px=float(y))


def draws(images: RealSet, presses: int | None, random: np.random.Generator) -> Iterator[tuple[list[Press], set[int]]]:
    """Yield the presses with some labels moved, and which: all of them, or so many drawn at random."""
    order = random.permutation(len(images.presses))
    size = presses or len(order)
    some = max(1, round(size / ONE_IN))
    for begin in range(0, len(order), some):
        wrong = order[begin : begin + some]
        others = [number for number in random.permutation(order) if number not in wrong][: size - len(wrong)]
        chosen = sorted([*wrong.tolist(), *(int(number) for number in others)])
        yield (
            [
                moved(images.presses[number], images, random) if number in wrong else images.presses[number]
                for number in chosen
            ],
            {position for position, number in enumerate(chosen) if number in wrong},
        )


def counted(images: RealSet, presses: int | None = None, most: int | None = None) -> Counted:
    """Move the labels of a set, and count which are named; most: draws, None for all."""
    found = Counted()
    for labelled, wrong in islice(draws(images, presses, np.random.default_rng(0)), most):
        named = {id(one.press) for one in wrong_labels.wrong_labels(labelled, images.reference, images.ball)}
        for position, press in enumerate(labelled):
            is_named = id(press) in named
            found.moved += position in wrong
            found.moved_named += is_named and position in wrong
            found.right += position not in wrong
            found.right_named += is_named and position not in wrong
    return found


def _remembered(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that computes once for each picture: its labels change nothing."""
    known: dict[bytes, Any] = {}

    def once(picture: np.ndarray, *arguments: Any, **how: Any) -> Any:
        key = picture.tobytes()
        if key not in known:
            try:
                known[key] = function(picture, *arguments, **how)
            except InputError as error:
                known[key] = error
        if isinstance(known[key], InputError):
            raise known[key]
        return known[key]

    return once


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", metavar="SET", help=f"of {', '.join(SETS)}; all where none is named")
    parser.add_argument("--presses", type=int, nargs="+", default=[0], help="so many of a set; 0: all")
    parser.add_argument("--draws", type=int, metavar="N", help="so many at most; else until every label was moved")
    given = parser.parse_args()
    for name in given.sets or SETS:
        images = SETS[name](Path(tempfile.mkdtemp(prefix="gellight-real-")))
        with ExitStack() as stack:
            for what in ("find_circle", "difference_of"):
                stack.enter_context(patch.object(wrong_labels, what, _remembered(getattr(wrong_labels, what))))
            for number in given.presses:
                print(
                    f"{name}, {number or len(images.presses)} presses: {counted(images, number, given.draws)}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
