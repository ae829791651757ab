"""Judge the tests of the host by faults: `python -m tests.benchmarks.mutants COUNT [SEED] [--jobs 2] [--limit-s 300]`.

Draws mutants of host/gellight at random. Each is judged in a copy of the checkout by the tests that import its file,
those of its own room first, until one fails. A test that fails counts where it passes without the mutant. Prints a
line for each mutant: killed, survived (with the number of test files that passed) or undecided (time ran out); then
the shares. The virtual machine, the browser's installation and whole programs do not judge: they take too long.
"""

import argparse
import ast
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

from tests.helpers.places import CHECKOUT
from tests.helpers.python_mutants import Mutant, draw

SOURCES = ("host", "models", "")
TOO_SLOW = ("tests/vm/", "tests/hardware/", "tests/soak/", "tests/firmware/test_mutants.py", "tests/test_")
MOST_S_A_TEST = 60


class Judgement(NamedTuple):
    """What became of a mutant: killed by a test, survived, or undecided."""

    verdict: str
    why: str


# ---- which tests judge ----


@cache
def imported_by(path: Path) -> frozenset[Path]:
    """Return the files of the checkout that a file imports, anywhere in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        if isinstance(node, ast.ImportFrom) and node.module:
            names.update([node.module, *(f"{node.module}.{alias.name}" for alias in node.names)])
    return frozenset(file for name in names for file in _files(name))


@cache
def _files(module: str) -> list[Path]:
    places = [CHECKOUT / source / module.replace(".", "/") for source in SOURCES]
    return [file for place in places for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file()]


@cache
def reached_by(test: Path) -> frozenset[Path]:
    """Return what a file of the tests imports, by itself or through other files of the tests."""
    found, new = {test}, {test}
    while new:
        new = {file for one in new if (CHECKOUT / "tests") in one.parents for file in imported_by(one)} - found
        found |= new
    return frozenset(found)


def judges(file: Path) -> list[str]:
    """Return the tests that import a file of the host: its own first, then those of its room, then the others.

    Its own are named after it, and need not import it: a verb is tested through the command line. Where there are
    none, those that import a file that imports it.
    """
    tests = [path for path in sorted((CHECKOUT / "tests").rglob("test_*.py"))
             if not str(path.relative_to(CHECKOUT)).startswith(TOO_SLOW)]  # fmt: skip
    room = file.relative_to(CHECKOUT / "host/gellight").parent
    own = CHECKOUT / "tests/host" / room
    named = {own / f"test_{file.stem}.py"}
    wanted, seen = {file}, {file}
    while wanted and not (found := [test for test in tests if wanted & reached_by(test) or test in named]):
        wanted = {other for other in (CHECKOUT / "host/gellight").rglob("*.py") if wanted & imported_by(other)} - seen
        seen |= wanted

    def distance(test: Path) -> tuple[bool, bool, int]:
        return test not in named, own not in test.parents, len(reached_by(test))

    return [str(test.relative_to(CHECKOUT)) for test in sorted(found, key=distance)] if wanted else []


# ---- judging ----


def judge(mutant: Mutant, tests: list[str], copy: Path, limit_s: float) -> Judgement:
    """Plant a mutant in a copy of the checkout, run its tests until one fails, and take it out."""
    file, end_s = copy / mutant.file.relative_to(CHECKOUT), time.monotonic() + limit_s
    if not tests:
        return Judgement("survived", "no test imports it")
    passed_over: list[str] = []
    while True:
        file.write_text(mutant.planted())
        try:
            failed = first_failure(tests, copy, end_s - time.monotonic(), passed_over)
        except subprocess.TimeoutExpired:
            return Judgement("undecided", f"not judged within {limit_s:g} s by {len(tests)} test files")
        finally:
            file.write_bytes(mutant.source)
        if not failed:
            return Judgement("survived", f"{len(tests)} test files pass")
        try:
            if not first_failure([failed], copy, limit_s, []):
                return Judgement("killed", failed)
        except subprocess.TimeoutExpired:
            pass
        passed_over.append(failed)  # it fails without the mutant, too


def first_failure(tests: list[str], copy: Path, limit_s: float, but: list[str]) -> str:
    """Return the first test that fails, "" if all pass; raises TimeoutExpired."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-rfE", "-p", "no:cacheprovider", "--timeout",
               str(MOST_S_A_TEST), *(f"--deselect={one}" for one in but), *tests]  # fmt: skip
    where = {"PYTHONPATH": os.pathsep.join(str(copy / source) for source in SOURCES), "PYTHONDONTWRITEBYTECODE": "1"}
    started = subprocess.Popen(command, cwd=copy, env=os.environ | where, text=True, start_new_session=True,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
    try:
        said, _ = started.communicate(timeout=max(limit_s, 1))
    finally:
        with_its_children(started)
    if started.returncode in (0, 5):  # 5: nothing was left to run
        return ""
    found = re.search(r"^(?:FAILED|ERROR) (\S+?)(?: - .*)?$", said, re.MULTILINE)
    return found[1] if found else tests[0]  # the process ended before pytest could tell


def with_its_children(started: subprocess.Popen[str]) -> None:
    """End a run and what it started."""
    with suppress(ProcessLookupError):
        os.killpg(started.pid, signal.SIGKILL)
    started.wait()


@contextmanager
def copies(count: int) -> Iterator[SimpleQueue[Path]]:
    """Copy what git knows of the checkout, that many times."""
    known = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=CHECKOUT,
                           check=True, capture_output=True, text=True).stdout.split("\0")  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        free: SimpleQueue[Path] = SimpleQueue()
        for number in range(count):
            for name in filter(lambda name: (CHECKOUT / name).is_file(), known):
                target = Path(folder) / str(number) / name
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(CHECKOUT / name, target)
            free.put(Path(folder) / str(number))
        yield free


def judged(mutants: list[Mutant], jobs: int, limit_s: float) -> Iterator[tuple[Mutant, Judgement]]:
    """Judge mutants side by side, and yield each as soon as it is judged."""
    tests = {mutant: judges(mutant.file) for mutant in mutants}  # the checkout may change while they are judged
    with copies(jobs) as free, ThreadPoolExecutor(jobs) as pool:

        def one(mutant: Mutant) -> tuple[Mutant, Judgement]:
            copy = free.get()
            try:
                return mutant, judge(mutant, tests[mutant], copy, limit_s)
            finally:
                free.put(copy)

        for done in as_completed([pool.submit(one, mutant) for mutant in mutants]):
            yield done.result()


def main() -> None:
    """Draw, judge, print."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.mutants", description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--limit-s", type=float, default=300.0)
    given = parser.parse_args()
    verdicts: list[str] = []
    mutants = draw(list((CHECKOUT / "host/gellight").rglob("*.py")), given.count, given.seed)
    for mutant, (verdict, why) in judged(mutants, given.jobs, given.limit_s):
        verdicts.append(verdict)
        print(f"{verdict:9} {str(mutant).removeprefix(f'{CHECKOUT}/')}  ({why})", flush=True)
    counts = {verdict: verdicts.count(verdict) for verdict in ("killed", "survived", "undecided")}
    decided = max(counts["killed"] + counts["survived"], 1)
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items())
          + f": {counts['killed'] / decided:.0%} of the decided ones are killed")  # fmt: skip


if __name__ == "__main__":
    main()
