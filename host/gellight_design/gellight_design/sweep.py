"""Studies: independent tasks spread over processes; each result is kept at once, and none is computed twice."""

import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar

import platformdirs
from joblib import Memory

import sim_reference
from gellight.base.errors import InputError
from gellight.lab import simulator
from gellight_design.simulating.processes import Progress, call_all

ResultT = TypeVar("ResultT")


@dataclass(frozen=True)
class Task:
    """A call of a module's function."""

    label: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class Study(Generic[ResultT]):
    """Tasks, and how their results, in the same order, become the result of the study."""

    tasks: list[Task]
    combine: Callable[[list[Any]], ResultT]


def kept_in() -> Path:
    """Return the folder of the user's cache where results are kept."""
    return platformdirs.user_cache_path("gellight") / "optimize"


def run_study(study: Study[ResultT], workers: int = 1, progress: Progress = lambda *told: None) -> ResultT:
    """Return the result of a study, and raise what a task raises.

    What was kept is not computed again; each new result is kept at once, so an interrupted study goes on where it
    stopped. Raises InputError where nothing can be kept.
    """
    kept, total = _keeper(), len(study.tasks)
    calls = [(_source(task.function), task.function, task.arguments) for task in study.tasks]
    missing = [number for number, call in enumerate(calls) if not kept.check_call_in_cache(*call)]
    done = total - len(missing)
    progress(done, total, "")

    def tell(number: int) -> None:
        nonlocal done
        done += 1
        progress(done, total, study.tasks[missing[number]].label)

    new = dict(zip(missing, call_all(kept, [calls[number] for number in missing], workers, tell), strict=True))
    return study.combine([new[number] if number in new else kept(*call) for number, call in enumerate(calls)])


def _keeper() -> Any:
    try:
        return Memory(kept_in(), verbose=0).cache(_call)
    except OSError as error:
        raise InputError(
            f"results cannot be kept in {kept_in()} ({error.strerror}): let XDG_CACHE_HOME name another folder"
        ) from error


def _call(source: str, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """Call a function; a result is kept by the source too, so that a mended simulator or study computes anew."""
    return function(*arguments)


def _source(function: Callable[..., Any]) -> str:
    """Return a digest of the simulators, this room, and the module of a function."""
    return hashlib.sha256(_rooms() + Path(inspect.getfile(function)).read_bytes()).hexdigest()


@cache
def _rooms() -> bytes:
    homes = [Path(inspect.getfile(package)).parent for package in (sim_reference, simulator)]
    files = [path for home in (*homes, Path(__file__).parent) for path in sorted(home.rglob("*.py"))]
    return b"".join(path.as_posix().encode() + b"\0" + path.read_bytes() for path in files)
