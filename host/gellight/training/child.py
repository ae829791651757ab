"""Run a module of `gelnet` in a child process, so that the host itself never loads torch."""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from gellight.base.errors import TrainingError

Progress = Callable[[int, int, float], None]
"""Called with (epoch, epochs, loss)."""
_REMEDY = 'pip install "gellight[train]"'


def silent(epoch: int, epochs: int, loss: float) -> None:
    """Report to nobody."""


def run_module(module: str, arguments: list[str], progress: Progress) -> None:
    """Run a module of gelnet in a child process and report its progress.

    Raises TrainingError with the last line of the child's error output unless it ends well. An interrupt ends the child
    as well.
    """
    if importlib.util.find_spec("torch") is None:
        raise TrainingError(f"training needs torch, which is not installed: {_REMEDY}")
    _run_child([sys.executable, "-m", module, *arguments], progress)


def _run_child(command: list[str], progress: Progress) -> None:
    """Do as `run_module` with any command that prints its progress."""
    with (
        tempfile.TemporaryFile("w+") as complaints,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=complaints, text=True, env=_environment()) as child,
    ):
        try:
            for line in child.stdout or ():
                step = json.loads(line)
                progress(step["epoch"], step["epochs"], step["loss"])
        except BaseException:
            child.kill()
            raise
        status = child.wait()
        complaints.seek(0)
        words = complaints.read().strip()
    if status:
        raise TrainingError(_last_words(words, status))


def _last_words(words: str, status: int) -> str:
    last = words.splitlines()[-1] if words else "it said nothing"
    if "No module named" in last:
        return f"training cannot start ({last}): {_REMEDY}"
    if status < 0:
        return f"training was ended by signal {-status} ({last}): is there enough memory?"
    return last.split(": ", 1)[-1] if status == 2 else f"training failed with status {status}: {last}"


def _environment() -> dict[str, str]:
    """The environment in which the child finds the `gelnet` that the host finds."""
    spec = importlib.util.find_spec("gelnet")
    if spec is None or not spec.submodule_search_locations:
        raise TrainingError("the package gelnet is not installed beside gellight: reinstall gellight")
    places = [str(Path(next(iter(spec.submodule_search_locations))).parent), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(place for place in places if place)}
