"""What tests start ends with them: see tests/helpers/children.py."""

import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from subprocess import PIPE

from tests.helpers.children import run, started


def runs(process: int) -> bool:
    """Tell whether a process runs; one that ended but was not waited for does not."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text()
    except FileNotFoundError:
        return False


def test_a_test_that_fails_leaves_neither_its_program_nor_what_that_started() -> None:
    with suppress(RuntimeError), started(["sh", "-c", "sleep 100 & echo $!; wait"], stdout=PIPE, text=True) as program:
        below = int(program.stdout.readline())
        assert runs(below)
        raise RuntimeError("the test fails")
    assert program.returncode == -signal.SIGKILL
    end_s = time.monotonic() + 10
    while runs(below) and time.monotonic() < end_s:
        time.sleep(0.01)
    assert not runs(below)


def test_a_program_that_fails_is_returned_with_its_status() -> None:
    done = run([sys.executable, "-c", "import os; print(os.getpid() == os.getsid(0)); raise SystemExit(3)"])
    assert (done.returncode, done.stdout) == (3, "True\n")
