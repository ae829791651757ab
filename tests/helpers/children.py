"""Programs that tests start: none is left behind, whatever happens to the test.

A program gets a session of its own, and at the end everything in it is killed, its own children too.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

GELLIGHT = (
    sys.executable,
    "-c",
    # A script that starts the tests in the background ignores Ctrl-C for all below it: here it ends the program again.
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\nfrom gellight.cli.main import run; run()",
)
"""the command line of this checkout, which the arguments follow"""


@contextmanager
def started(command: Sequence[str | os.PathLike[str]], **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Start a program; options: of `subprocess.Popen`. At the end kill what still runs, and close its pipes."""
    with subprocess.Popen(command, start_new_session=True, **options) as program:
        try:
            yield program
        finally:
            with suppress(ProcessLookupError):
                os.killpg(program.pid, signal.SIGKILL)


def run(
    command: Sequence[str | os.PathLike[str]], *, check: bool = False, timeout_s: float = 200, **options: Any
) -> subprocess.CompletedProcess[Any]:
    """Run a program to its end and return what it printed, as text unless the options of `started` say otherwise.

    Raises TimeoutExpired, and with `check` CalledProcessError.
    """
    options = {
        "stdin": subprocess.DEVNULL,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "text": True,
    } | options
    with started(command, **options) as program:
        out, err = program.communicate(timeout=timeout_s)
    done = subprocess.CompletedProcess(list(command), program.returncode, out, err)
    if check:
        done.check_returncode()
    return done


def gellight(*arguments: str | os.PathLike[str], **options: Any) -> subprocess.CompletedProcess[str]:
    """Run `gellight` with these arguments; options: of `run`."""
    return run([*GELLIGHT, *arguments], **options)
