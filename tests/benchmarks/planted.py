"""Plant faults in the firmware, one at a time, and say which check of the image notices each.

`python -m tests.benchmarks.planted enables` takes a list of `tests/firmware/helpers`; `apart 27-40 "the vectors"` takes
some of it, by number or by a part of the name, so that a run that was cut off can go on. The first check that notices a
fault ends the search.
"""

import argparse
import re
import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from gellight.base.errors import InputError
from gellight.ring.firmware.build import build
from tests.firmware.helpers import faults_apart, faults_drawn, mutations
from tests.firmware.helpers.examination import CHECKS, examine
from tests.firmware.helpers.mutations import Mutation, planted
from tests.helpers.places import CHECKOUT

LISTS = {
    "enables": mutations.ENABLES,
    "apart": faults_apart.APART,
    "further": faults_apart.FURTHER,
    "drawn": faults_drawn.DRAWN,
}


def noticed_by(mutation: Mutation, checkout: Path) -> str:
    """Return the check that notices a fault, and what it says; "" where none does."""
    with planted(mutation, checkout):
        try:
            image = build(checkout)
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
    parser.add_argument("list", choices=LISTS)
    parser.add_argument("which", nargs="*", help="numbers, ranges or parts of names; all by default")
    given = parser.parse_args()
    mutants = chosen_of(LISTS[given.list], given.which)
    noticed = 0
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(CHECKOUT / "firmware", Path(folder) / "firmware")
        for number, mutation in mutants:
            begun_s = time.process_time()
            said = noticed_by(mutation, Path(folder))
            noticed += bool(said)
            spent_s = time.process_time() - begun_s
            print(f"{number:2} {mutation.name:45} {said[:120] or 'NOT NOTICED'} ({spent_s:.1f} s)", flush=True)
    print(f"{noticed} of {len(mutants)} noticed")


if __name__ == "__main__":
    main()
