"""Plant faults in the firmware, one at a time, and say which check of the image notices each.

`python -m tests.benchmarks.planted enables` takes a list of `tests/firmware/helpers`; `apart 27-40 "the vectors"` takes
some of it, by number or by a part of the name, so that a run that was cut off can go on. `chance --seed 7` draws forty
that nobody had in mind. The first check that notices a fault ends the search.
"""

import argparse
import re
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path

from gellight.base.errors import InputError
from gellight.ring.firmware.build import build
from tests.firmware.helpers import faults_apart, faults_by_chance, faults_drawn, mutations
from tests.firmware.helpers.examination import CHECKS, examine
from tests.firmware.helpers.mutations import Mutation, planted
from tests.helpers.places import CHECKOUT

LISTS = {
    "enables": mutations.ENABLES,
    "apart": faults_apart.APART,
    "further": faults_apart.FURTHER,
    "drawn": faults_drawn.DRAWN,
}


def image_with(mutation: Mutation, checkout: Path) -> bytes:
    """Return the image that is built with a fault; InputError where the compiler refuses it."""
    with planted(mutation, checkout):
        return build(checkout)


def by_chance(seed: int, checkout: Path) -> Iterator[Mutation]:
    """Yield faults drawn by chance that the compiler takes and that change the image."""
    sound = build(checkout)
    for mutation in faults_by_chance.drawn(checkout, seed):
        with suppress(InputError):
            if image_with(mutation, checkout) != sound:
                yield mutation


def noticed_by(mutation: Mutation, checkout: Path) -> str:
    """Return the check that notices a fault, and what it says; "" where none does."""
    try:
        image = image_with(mutation, checkout)
    except InputError as error:
        return f"the compiler: {str(error).splitlines()[-1]}"
    first = mutation.check
    for check in (first, *(name for name in CHECKS if name != first)):
        if found := examine(image, check):
            return f"{check}: {found[0]}"
    return ""


def chosen_of(mutants: Sequence[Mutation], wanted: list[str]) -> list[tuple[int, Mutation]]:
    """Return the faults that numbers (7), ranges (27-40) or parts of names choose, numbered from 1; all without any.

    Raises InputError where one of `wanted` chooses none.
    """
    numbered = list(enumerate(mutants, 1))
    if not wanted:
        return numbered
    chosen: dict[int, Mutation] = {}
    for word in wanted:
        limits = re.fullmatch(r"(\d+)(?:-(\d+))?", word)
        first, last = (int(limits[1]), int(limits[2] or limits[1])) if limits else (0, 0)
        found = {n: m for n, m in numbered if (first <= n <= last if limits else word in m.name)}
        if not found:
            raise InputError(f"no fault is {word}: give a number of 1 to {len(mutants)}, a range (3-7), part of a name")
        chosen |= found
    return sorted(chosen.items())


def main() -> None:
    """Print a line for each fault, then how many were noticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("list", choices=[*LISTS, "chance"])
    parser.add_argument("which", nargs="*", help="numbers, ranges or parts of names; all by default")
    parser.add_argument("--seed", type=int, default=1, help="of `chance`")
    parser.add_argument("--count", type=int, default=40, help="of `chance`")
    given = parser.parse_args()
    noticed = 0
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(CHECKOUT / "firmware", Path(folder) / "firmware")
        drawn = (
            islice(by_chance(given.seed, Path(folder)), given.count) if given.list == "chance" else LISTS[given.list]
        )
        mutants = chosen_of(list(drawn), given.which)
        for number, mutation in mutants:
            begun_s = time.process_time()
            said = noticed_by(mutation, Path(folder))
            noticed += bool(said)
            spent_s = time.process_time() - begun_s
            print(f"{number:2} {mutation.name:45} {said[:120] or 'NOT NOTICED'} ({spent_s:.1f} s)", flush=True)
    print(f"{noticed} of {len(mutants)} noticed")


if __name__ == "__main__":
    main()
