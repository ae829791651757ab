"""Many independent computations: spread over processes, each kept as soon as it is there, none done twice."""

import hashlib
import importlib.util
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from gellight.base.errors import InputError
from gellight.design.store import ResultStore

Progress = Callable[[int, int, str], None]
"""called with done, total and what was finished last, nothing at first"""


@dataclass(frozen=True)
class Task:
    """A call of a function of a module, with arguments whose `repr` says all about them."""

    label: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]

    @property
    def key(self) -> str:
        """Name of the result: it changes with the function, its arguments and the source of the simulator."""
        call = f"{self.function.__module__}.{self.function.__qualname__}{self.arguments!r}"
        return hashlib.sha256(f"{simulator_digest()}\n{call}".encode()).hexdigest()


@dataclass(frozen=True)
class Shard:
    """One of `count` equal parts of a sweep, counted from 1."""

    number: int = 1
    count: int = 1

    def holds(self, position: int) -> bool:
        """Return whether the task at `position` belongs to this part."""
        return position % self.count == self.number - 1


@dataclass(frozen=True, kw_only=True)
class Way:
    """How a sweep is computed."""

    store: ResultStore
    workers: int = 1
    shard: Shard = Shard()
    scheduler: str | None = None
    """address of a Dask scheduler, instead of processes on this machine"""
    progress: Progress | None = None


def parse_shard(text: str) -> Shard:
    """Read `i/n`; raises InputError unless 1 <= i <= n."""
    number, slash, count = text.partition("/")
    if not (slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise InputError(f"--shard {text!r}: give i/n with 1 <= i <= n, such as 2/4")
    return Shard(int(number), int(count))


@cache
def simulator_digest() -> str:
    """Return the digest of the simulator's source: results of another version are not used."""
    found = importlib.util.find_spec("sim_reference")
    assert found is not None
    assert found.origin is not None
    root = Path(found.origin).parent
    total = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        total.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return total.hexdigest()


def available_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run(tasks: Sequence[Task], way: Way) -> list[Any | None]:
    """Return the results in the order of `tasks`, None for those of other shards that are not there yet.

    What the store holds is not computed; what is computed is stored at once, so an interrupted sweep goes on where it
    stopped. Raises what a task raises.
    """
    results = [way.store.get(task.key) for task in tasks]
    missing = [at for at, found in enumerate(results) if found is None and way.shard.holds(at)]
    done = sum(found is not None for found in results)
    if way.progress:
        way.progress(done, len(tasks), "")
    for at, result in _computed([(at, tasks[at]) for at in missing], way):
        way.store.put(tasks[at].key, result)
        results[at] = result
        done += 1
        if way.progress:
            way.progress(done, len(tasks), tasks[at].label)
    return results


def _computed(numbered: list[tuple[int, Task]], way: Way) -> Iterator[tuple[int, Any]]:
    if not numbered:
        return
    if way.workers == 1 and way.scheduler is None:
        for at, task in numbered:
            yield at, task.function(*task.arguments)
        return
    with executor(way) as pool:
        waiting = {pool.submit(task.function, *task.arguments): at for at, task in numbered}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BrokenExecutor:
            raise InputError(
                f"a worker was killed, perhaps because memory was short: use fewer --workers than {way.workers}. What "
                f"is done is kept in {way.store.folder}; the same command goes on there"
            ) from None
        finally:
            for future in waiting:
                future.cancel()


@contextmanager
def executor(way: Way) -> Iterator[Executor]:
    """Yield what runs the tasks: processes of this machine, or a Dask cluster."""
    if way.scheduler is None:
        # Not forked: a progress bar's thread may hold a lock at that moment.
        with ProcessPoolExecutor(way.workers, multiprocessing.get_context("forkserver")) as pool:
            yield pool
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError('--scheduler needs Dask: pip install "gellight[cluster]"') from None
    try:
        client = Client(way.scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler at {way.scheduler} ({error}): start one with `dask scheduler`") from error
    with client:
        yield client.get_executor()
