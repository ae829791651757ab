"""Plant faults in the firmware, one at a time, and say which check of the image notices each.

`python -m tests.benchmarks.planted enables` takes a list of `tests/firmware/helpers`; a check that runs into one of the
faults ends the search.
"""

import argparse
import shutil
import tempfile
import time
from pathlib import Path

from gellight.base.errors import InputError
from gellight.ring.firmware.build import build
from tests.firmware.helpers import faults_apart, mutations
from tests.firmware.helpers.examination import CHECKS, examine
from tests.firmware.helpers.mutations import Mutation, planted
from tests.helpers.places import CHECKOUT

LISTS = {"enables": mutations.ENABLES, "apart": faults_apart.APART}


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


def main() -> None:
    """Print a line for each fault, then how many were noticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("list", choices=LISTS)
    parser.add_argument("--only", default="", help="those with this in their name")
    chosen = parser.parse_args()
    mutants = [mutation for mutation in LISTS[chosen.list] if chosen.only in mutation.name]
    noticed = 0
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(CHECKOUT / "firmware", Path(folder) / "firmware")
        for mutation in mutants:
            begun_s = time.process_time()
            said = noticed_by(mutation, Path(folder))
            noticed += bool(said)
            spent_s = time.process_time() - begun_s
            print(f"{mutation.name:45} {said[:120] or 'NOT NOTICED'} ({spent_s:.1f} s)", flush=True)
    print(f"{noticed} of {len(mutants)} noticed")


if __name__ == "__main__":
    main()
