"""Sweeps: independent tasks spread over processes; each result is kept at once, and none is computed twice."""

import hashlib
import importlib.util
import inspect
import json
import logging
import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, ProcessPoolExecutor, as_completed
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar

import platformdirs

from gellight.base.errors import InputError, first_line
from gellight.base.packages import needed
from gellight.base.parent import end_with_parent
from gellight.base.writing import write_file

logger = logging.getLogger(__name__)
Progress = Callable[[int, int, str], None]
"""called with the number of tasks done, of all tasks, and the label of the last one done, "" at first"""
ResultT = TypeVar("ResultT")


@dataclass(frozen=True)
class Task:
    """A call of a module's function; the `repr` of its arguments must tell them apart, its result must fit JSON."""

    label: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]

    @property
    def key(self) -> str:
        """Digest of the function's name, arguments and module, and of the simulator: it names the result."""
        call = f"{self.function.__module__}.{self.function.__qualname__}{self.arguments!r}"
        module = Path(inspect.getfile(self.function)).read_bytes()
        return hashlib.sha256(f"{simulator_digest()}\n{call}\n".encode() + module).hexdigest()


def default_folder() -> Path:
    """Return the folder in the user's cache where results are kept by default."""
    return platformdirs.user_cache_path("gellight") / "optimize"


class ResultStore:
    """A folder of results; each file is written whole or not at all."""

    def __init__(self, folder: Path) -> None:
        """Use `folder`, made if need be; raises InputError if that is impossible."""
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"results cannot be kept in {folder} ({error.strerror}): choose another --store"
            ) from error

    def path(self, key: str) -> Path:
        """Return the file of a result."""
        return self.folder / f"{key}.json"

    def get(self, key: str) -> Any | None:
        """Return a result, or None where there is none; a file that is damaged is reported and counts as none."""
        path = self.path(key)
        try:
            envelope = json.loads(path.read_bytes())
            if envelope["key"] == key and envelope["sha256"] == _digest(envelope["result"]):
                return envelope["result"]
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError):
            pass
        logger.warning("%s is damaged: computing it again", path)
        return None

    def put(self, key: str, result: Any) -> None:
        """Keep a result that JSON can hold; raises InputError if it cannot be written."""
        envelope = {"key": key, "sha256": _digest(result), "result": result}
        try:
            write_file(self.path(key), json.dumps(envelope).encode())
        except OSError as error:
            raise InputError(
                f"{self.path(key)} cannot be written ({error.strerror}): free some space, or choose another --store"
            ) from error


def _digest(result: Any) -> str:
    return hashlib.sha256(json.dumps(result).encode()).hexdigest()


@dataclass(frozen=True)
class Shard:
    """Part `number`, counted from 1, of a sweep that is cut into `count` equal parts."""

    number: int = 1
    count: int = 1

    def holds(self, position: int) -> bool:
        """Return whether the task at `position` belongs to this part."""
        return position % self.count == self.number - 1


@dataclass(frozen=True, kw_only=True)
class SweepOptions:
    """Where a sweep keeps its results, which part of it is computed, and by what."""

    store: ResultStore
    workers: int = 1
    shard: Shard = Shard()
    scheduler: str | None = None
    """address of a Dask scheduler, instead of processes on this machine"""
    progress: Progress | None = None


@dataclass(frozen=True)
class Study(Generic[ResultT]):
    """Tasks, and how their results, in the same order, become the result of the study."""

    tasks: list[Task]
    combine: Callable[[list[Any]], ResultT]


class SweepIncomplete(Exception):  # noqa: N818 - nothing went wrong
    """This shard is done; results of other shards are missing in the store."""


def parse_shard(text: str) -> Shard:
    """Read `i/n`; raises InputError unless 1 <= i <= n."""
    number, slash, count = text.partition("/")
    if not (slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise InputError(f"--shard {text!r}: give i/n with 1 <= i <= n, such as 2/4")
    return Shard(int(number), int(count))


@cache
def simulator_digest() -> str:
    """Return the digest of `sim_reference` and of this room, so that results of another version are not used."""
    found = importlib.util.find_spec("sim_reference")
    assert found is not None
    assert found.origin is not None
    total = hashlib.sha256()
    for root in (Path(found.origin).parent, Path(__file__).parent):
        for path in sorted(root.rglob("*.py")):
            total.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return total.hexdigest()


def available_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_study(study: Study[ResultT], options: SweepOptions) -> ResultT:
    """Return the result of a study; raises SweepIncomplete while shards are missing, and what a task raises."""
    return study.combine(run_all(study.tasks, options))


def run_all(tasks: Sequence[Task], options: SweepOptions) -> list[Any]:
    """Return all results in the order of `tasks`; raises SweepIncomplete, after the work, if some are missing."""
    results = run(tasks, options)
    if any(result is None for result in results):
        raise SweepIncomplete
    return results


def run(tasks: Sequence[Task], options: SweepOptions) -> list[Any | None]:
    """Return the results in the order of `tasks`, None for those of other shards that the store does not hold.

    What the store holds is not computed again; each new result is stored at once, so an interrupted sweep goes on
    where it stopped. Raises what a task raises.
    """
    results = [options.store.get(task.key) for task in tasks]
    missing = [at for at, found in enumerate(results) if found is None and options.shard.holds(at)]
    done = sum(found is not None for found in results)
    if options.progress:
        options.progress(done, len(tasks), "")
    with closing(_computed([(at, tasks[at]) for at in missing], options)) as computed:
        for at, result in computed:
            options.store.put(tasks[at].key, result)
            results[at] = result
            done += 1
            if options.progress:
                options.progress(done, len(tasks), tasks[at].label)
    return results


def _computed(numbered: list[tuple[int, Task]], options: SweepOptions) -> Generator[tuple[int, Any]]:
    if not numbered:
        return
    if options.workers == 1 and options.scheduler is None:
        for at, task in numbered:
            yield at, task.function(*task.arguments)
        return
    with executor(options) as pool:
        waiting = {pool.submit(task.function, *task.arguments): at for at, task in numbered}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BrokenExecutor:
            raise InputError(
                f"a worker was killed, perhaps because memory was short: use fewer --workers than {options.workers}. "
                f"What is done is kept in {options.store.folder}; the same command goes on there"
            ) from None


def _begin_worker() -> None:
    # Ctrl-C in a terminal reaches the workers too; they leave it to the process that started them.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


@contextmanager
def executor(options: SweepOptions) -> Iterator[Executor]:
    """Yield the pool that runs the tasks: processes of this machine, or a Dask cluster.

    Raises InputError if Dask is not installed, its scheduler does not answer or goes away, or has another GelLight.
    """
    if options.scheduler is None:
        # Not forked: a progress bar's thread may hold a lock at that moment.
        context = multiprocessing.get_context("forkserver")
        with ProcessPoolExecutor(options.workers, context, initializer=_begin_worker) as pool:
            try:
                yield pool
            except BaseException:
                # The pool would wait for what it computes, which may take a minute. No future may be cancelled before:
                # a thread of the pool fails at a cancelled one when the workers are gone, and the program never ends.
                pool.shutdown(wait=False)
                for worker in multiprocessing.active_children():
                    worker.kill()
                raise
        return
    with _cluster(options.scheduler, options.store.folder) as pool:
        yield pool


@contextmanager
def _cluster(scheduler: str, kept_in: Path) -> Iterator[Executor]:
    with needed('--scheduler needs Dask: pip install "gellight[cluster]"'):
        from distributed import Client, KilledWorker
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler at {scheduler} ({first_line(error)}): start one with `dask scheduler`"
        ) from error
    kept = f"What is done is kept in {kept_in}; the same command goes on there"
    with client:
        if not client.scheduler_info()["workers"]:
            logger.warning("waiting for workers: start some with `dask worker %s`", scheduler)
        try:
            yield client.get_executor()
        except CancelledError:
            raise InputError(f"the Dask scheduler at {scheduler} is gone. {kept}") from None
        except KilledWorker as error:
            raise InputError(
                f"Dask's workers were killed, perhaps because memory was short ({error}). {kept}"
            ) from None
        except (ImportError, RuntimeError) as error:
            if isinstance(error, ImportError) or "deserialization" in str(error):
                raise InputError(
                    f"the Dask scheduler at {scheduler} and its workers need the GelLight that this program has: "
                    f"install it there ({error.__cause__ or error})"
                ) from error
            raise
