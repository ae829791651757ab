"""Judge the tests of the host by faults: `python -m tests.benchmarks.mutants COUNT [SEED] [--under sensor/v4l2]`.

Draws mutants of host/gellight at random, as many in each room. Each is judged in a copy of the checkout until a test
fails: by the tests that import its file, or type its verb, and all of its own room first; then by some of other rooms
that only drive it. A test that fails counts where it passes without the mutant. Prints a line for each mutant: killed,
survived (with the number of test files that passed) or undecided (its room took too long); then the shares, room by
room. What runs at night, the virtual machine and whole programs do not judge: they take too long.
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
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from functools import cache
from itertools import zip_longest
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

from tests.helpers.places import CHECKOUT
from tests.helpers.python_mutants import Mutant, draw

SOURCES = ("host", "models", "")
TOO_SLOW = ("tests/vm/", "tests/hardware/", "tests/soak/", "tests/firmware/test_mutants.py", "tests/test_")
HOST = CHECKOUT / "host/gellight"
COMMAND_LINE = HOST / "cli"
VERB_TABLES = ("main.py", "calibrate/verbs.py")
TYPISTS = {CHECKOUT / "tests/helpers" / name for name in ("command_line.py", "children.py")}
FEW = 4
"""files: the verbs of a file that more import say little about it"""
MOST_DRIVERS = 12
"""files of tests that reach a module through others only: the nearest of each room in turn"""
MORE_OUTSIDE = 0.5
"""of the time that its own room has: how much more those of other rooms have"""
MOST_S_A_TEST = 60


class Judgement(NamedTuple):
    """What became of a mutant: killed by a test, survived, or undecided."""

    verdict: str
    why: str


class Judges(NamedTuple):
    """The files of tests that judge a module: the one named after it, others of its room, and some of other rooms."""

    named: list[str]
    room: list[str]
    outside: list[str]


def room_of(file: Path) -> str:
    """Return the room of a file of the host: the folder that holds it, of lab/ the folder in there."""
    folders = file.relative_to(HOST).parent.parts
    return "/".join(folders[: 2 if folders[:1] == ("lab",) else 1]) or "opening"


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


@cache
def verbs() -> dict[Path, set[str]]:
    """Return the files of the command line that are imported when a verb is typed, with the words that name it."""
    found: dict[Path, set[str]] = {}
    for group in VERB_TABLES:
        for node in ast.walk(ast.parse((COMMAND_LINE / group).read_text())):
            pairs = zip(node.keys, node.values, strict=True) if isinstance(node, ast.Dict) else ()
            for word, value in ((word, value) for word, value in pairs if isinstance(value, ast.Tuple)):
                home = ast.literal_eval(value)[0].partition(":")[0]
                found.setdefault(COMMAND_LINE / f"{home.replace('.', '/')}.py", set()).add(ast.literal_eval(word))
    return found


@cache
def typed_by(test: Path) -> frozenset[str]:
    """Return the strings in a file of the tests that uses the command line, none in others."""
    if not imported_by(test) & TYPISTS:
        return frozenset()
    nodes = ast.walk(ast.parse(test.read_text()))
    return frozenset(node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str))


def named_after(file: Path) -> Path:
    """Return where the tests of a file of the host are, if it has its own."""
    return CHECKOUT / "tests/host" / file.relative_to(HOST).parent / f"test_{file.stem}.py"


def _typing(files: set[Path], tests: list[Path]) -> set[Path]:
    """Return the tests that type a verb of these files."""
    words = {word for file in files for word in verbs().get(file, ())}
    return {test for test in tests if words & typed_by(test)} if words else set()


@cache
def all_tests() -> list[Path]:
    return [path for path in sorted((CHECKOUT / "tests").rglob("test_*.py"))
            if not str(path.relative_to(CHECKOUT)).startswith(TOO_SLOW)]  # fmt: skip


def judges(file: Path) -> Judges:
    """Return the tests that import a file of the host, or type its verb; outside its room also some that drive it.

    Of those that import it, what belongs to the files that import it, or types few verbs that do, is the last.
    """
    named, tests = named_after(file), all_tests()
    importers = importers_of(file)
    users = {named_after(other) for other in importers}
    users |= _typing(set(importers) if len(importers) <= FEW else set(), tests)
    typing = _typing({file}, tests)
    found = [test for test in tests if file in reached_by(test) or test in {named} | users | typing]
    found.sort(key=lambda test: (test in users, named.parent not in test.parents, len(reached_by(test))))
    in_room = [test for test in [*found, *tests] if CHECKOUT / "tests/host" / room_of(file) in test.parents]
    in_room = list(dict.fromkeys(in_room))
    room = [test for test in in_room if test != named]
    outside = [test for test in found if test not in [named, *in_room]] + drivers(file, {*found, *in_room})
    return Judges(*([str(test.relative_to(CHECKOUT)) for test in group]
                    for group in ([named] if named in found else [], room, outside)))  # fmt: skip


@cache
def importers_of(file: Path) -> list[Path]:
    """Return the files of the host that import a file."""
    return [other for other in sorted(HOST.rglob("*.py")) if file in imported_by(other)]


def drivers(file: Path, but: set[Path]) -> list[Path]:
    """Return the tests that reach a file of the host through other files: the nearest of each room in turn."""
    steps, level = {file: 0}, [file]
    while level:
        level = [other for other in {above for one in level for above in importers_of(one)} if other not in steps]
        steps |= dict.fromkeys(level, max(steps.values()) + 1)
    words = {word: steps[verb] for verb, named in verbs().items() if verb in steps for word in named}
    rooms: dict[Path, list[tuple[int, int, Path]]] = {}
    for test in (test for test in all_tests() if test not in but):
        ways = [steps[one] for one in reached_by(test) if one in steps] + [
            words[one] for one in typed_by(test) & words.keys()
        ]
        if ways:
            rooms.setdefault(test.parent, []).append((min(ways), len(reached_by(test)), test))
    in_turn = zip_longest(*sorted(map(sorted, rooms.values())))
    return [driver[-1] for turn in in_turn for driver in turn if driver][:MOST_DRIVERS]


# ---- judging ----


def judge(mutant: Mutant, tests: Judges, copy: Path, limit_s: float) -> Judgement:
    """Plant a mutant in a copy of the checkout, run its tests until one fails, and take it out."""
    end_s, passed = time.monotonic() + limit_s, 0
    for group in (tests.named, tests.room):
        try:
            if failed := seen(mutant, group, copy, end_s):
                return Judgement("killed", failed)
        except subprocess.TimeoutExpired:
            return Judgement("undecided", f"not judged within {limit_s:g} s by {passed + len(group)} test files")
        passed += len(group)
    why = f"{passed} test files of its room pass, and {len(tests.outside)} of others"
    try:
        failed = seen(mutant, tests.outside, copy, end_s + MORE_OUTSIDE * limit_s)
    except subprocess.TimeoutExpired:
        return Judgement("survived", f"{why}, as far as there was time")
    return Judgement("killed", failed) if failed else Judgement("survived", why)


def seen(mutant: Mutant, tests: list[str], copy: Path, end_s: float) -> str:
    """Return the first of these tests that fails with a mutant and passes without it, "" if none does.

    Raises TimeoutExpired.
    """
    file = copy / mutant.file.relative_to(CHECKOUT)
    passed_over: list[str] = []
    while tests:
        file.write_text(mutant.planted())
        try:
            failed = first_failure(tests, copy, end_s - time.monotonic(), passed_over)
        finally:
            file.write_bytes(mutant.source)
        if not failed:
            break
        with suppress(subprocess.TimeoutExpired):
            if not first_failure([failed], copy, 2 * MOST_S_A_TEST, []):
                return failed
        passed_over.append(failed)  # it fails without the mutant, too
    return ""


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
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.mutants", description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--under", default="", help="draw from this folder or file of host/gellight alone")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--limit-s", type=float, default=300.0)
    given = parser.parse_args()
    place = HOST / given.under
    rooms: dict[str, list[Path]] = {}
    for file in [place] if place.is_file() else sorted(place.rglob("*.py")):
        rooms.setdefault(room_of(file), []).append(file)
    verdicts: dict[str, Counter[str]] = {room: Counter() for room in rooms}
    for mutant, (verdict, why) in judged(draw(rooms, given.count, given.seed), given.jobs, given.limit_s):
        verdicts[room_of(mutant.file)][verdict] += 1
        print(f"{verdict:9} {str(mutant).removeprefix(f'{CHECKOUT}/')}  ({why})", flush=True)
    for room, counts in (verdicts | {"all": sum(verdicts.values(), Counter())}).items():
        if counts:
            print(f"{room:20} {share(counts)}")


def share(counts: Counter[str]) -> str:
    """Say what became of mutants, and which share of the decided ones is killed."""
    decided = max(counts["killed"] + counts["survived"], 1)
    said = ", ".join(f"{counts[verdict]} {verdict}" for verdict in ("killed", "survived", "undecided"))
    return f"{said}: {counts['killed'] / decided:.0%} of the decided ones are killed"


if __name__ == "__main__":
    main()
