"""The tests of the core, collected once and run on many libraries: a mutant needs no new Python and no new pytest.

The server is a pytest that has collected the tests and then waits, as a plugin of itself. For each library it forks a
child, and the child runs the tests.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple, Self

import pytest

from tests.helpers.places import CHECKOUT

LONGEST = "test_a_power_cut_at_any_byte_loses_at_most_the_record_being_written"
"""takes longer than all others together: it runs last, when no other has noticed the fault"""


class Outcome(NamedTuple):
    """How a run ended: the exit status of pytest, and what it printed."""

    status: int
    printed: str


class CoreTests:
    """Runs the tests of the core on one library after another, each to the first failure."""

    def __enter__(self) -> Self:
        """Start the server; without plugins, which take longer than the tests do."""
        tests = map(str, sorted((CHECKOUT / "tests/firmware").glob("test_core*.py")))
        self._server = subprocess.Popen(
            [sys.executable, "-m", "pytest", "-q", "-x", "-s", "-p", "no:cacheprovider", "-p", __name__, *tests],
            cwd=CHECKOUT, env=os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        return self

    def __exit__(self, *_: object) -> None:
        self._server.communicate()

    def run(self, library: Path) -> Outcome:
        """Run the tests on a library until one fails."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        print(library, file=self._server.stdin, flush=True)
        said = []
        for line in self._server.stdout:
            if line.startswith("status "):
                return Outcome(int(line.split()[1]), library.with_suffix(".txt").read_text())
            said.append(line)
        raise AssertionError("the tests of the core did not start:\n" + "".join(said))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest test last."""
    items.sort(key=lambda item: item.name == LONGEST)


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Fork for every library that standard input names: the child goes on to the tests, and prints into a file."""
    if session.testsfailed:
        return None  # pytest says which file could not be collected
    for line in sys.stdin:
        library = Path(line.strip())
        sys.stdout.flush()
        child = os.fork()
        if not child:
            _answer_into(library.with_suffix(".txt"))
            os.environ["GELLIGHT_CORE_LIBRARY"] = str(library)
            return None
        print("status", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
    return True


def _answer_into(path: Path) -> None:
    """Send all that this process and the library print into a file, and read no more libraries."""
    nothing = os.open(os.devnull, os.O_RDONLY)
    output = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for old, new in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(old, new)
