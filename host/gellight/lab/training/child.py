"""Run a module of `gelnet` in a child process: the host never loads torch, and an abort ends the training at once."""

import importlib.util
import json
import os
import select
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from gellight.base.errors import TrainingError

RECIPES = ("fast", "thorough", "fine", "paper")
_BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""read by NumPy's matrix library when it is loaded; each build of NumPy heeds one of them"""


def gelnet_environment() -> dict[str, str]:
    """Return the environment in which the child finds the host's `gelnet` and computes with one thread."""
    spec = importlib.util.find_spec("gelnet")
    if spec is None or not spec.submodule_search_locations:
        raise TrainingError("the package gelnet is not installed beside gellight: reinstall gellight")
    places = [str(Path(next(iter(spec.submodule_search_locations))).parent), os.environ.get("PYTHONPATH", "")]
    path = {"PYTHONPATH": os.pathsep.join(place for place in places if place)}
    return {**os.environ, **dict.fromkeys(_BLAS_THREADS, "1"), **path}


Progress = Callable[[int, int, float], None]
"""Called with (epoch, epochs, loss)."""
Check = Callable[[], None]
"""Called several times a second; what it raises ends the child."""
_CHECK_S = 0.2  # chosen: how late a stop is obeyed
_REMEDY = "reinstall gellight"
_REFUSED = 2
"""exit status with which a child refuses what it was given"""


class RefusedTableError(TrainingError):
    """GelNet cannot learn from these presses, or not with those of that like unit."""


def silent(epoch: int, epochs: int, loss: float) -> None:
    """Report to nobody."""


def go_on() -> None:
    """Let the child run to its end."""


def run_module(module: str, arguments: list[str], progress: Progress, *, check: Check = go_on) -> None:
    """Run a module of gelnet in a child process and report its progress.

    NumPy trains, where the arguments name no other. Raises TrainingError with the last line of the child's error output
    unless it ends well. An interrupt ends the child as well.
    """
    _run_child([sys.executable, "-m", module, "--trainer=numpy", "--attached", *arguments], progress, check=check)


def _run_child(command: list[str], progress: Progress, *, check: Check = go_on) -> None:
    """Do as `run_module` with any command that prints its progress."""
    with (
        tempfile.TemporaryFile("w+") as complaints,
        subprocess.Popen(
            command,
            stdin=subprocess.PIPE,  # closed when this process ends, however and whenever: then the child ends too
            stdout=subprocess.PIPE,
            stderr=complaints,
            env=gelnet_environment(),
        ) as child,
    ):
        try:
            for line in _lines(child, check):
                if (step := _step(line)) is not None:
                    progress(*step)
        except BaseException:
            child.kill()
            raise
        status = child.wait()
        complaints.seek(0)
        text = complaints.read().strip()
    if status:
        raise (RefusedTableError if status == _REFUSED else TrainingError)(_reason(text, status))


def _lines(child: subprocess.Popen[bytes], check: Check) -> Iterator[bytes]:
    """Yield the lines of a child's output as they come, and check in between."""
    assert child.stdout is not None
    begun = b""
    while True:
        check()
        if not select.select([child.stdout], [], [], _CHECK_S)[0]:
            continue
        part = os.read(child.stdout.fileno(), 1 << 16)
        if not part:
            return
        *lines, begun = (begun + part).split(b"\n")
        yield from lines


def _step(line: bytes) -> tuple[int, int, float] | None:
    """Return epoch, epochs and loss of a line of progress; None for what a library of the child's has printed."""
    try:
        step = json.loads(line)
        return step["epoch"], step["epochs"], step["loss"]
    except (ValueError, KeyError, TypeError):
        return None


def _reason(text: str, status: int) -> str:
    last = text.splitlines()[-1] if text else "it said nothing"
    if "No module named" in last:
        return f"training cannot start ({last}): {_REMEDY}"
    if status < 0:
        return f"training was ended by signal {-status} ({last}): is there enough memory?"
    return last.split(": ", 1)[-1] if status == _REFUSED else f"training failed with status {status}: {last}"
