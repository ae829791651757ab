"""Many calls of one function, spread over processes."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, as_completed
from contextlib import closing
from typing import Any

from gellight.base.errors import InputError


def end_with_parent() -> None:
    """End this process by SIGTERM when the one that started it is gone, however that ended.

    For a process that `multiprocessing` started. A thread waits for it.
    """
    threading.Thread(target=_end, name="parent", daemon=True).start()


def _end() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)


Progress = Callable[[int, int, str], None]
"""called with the number of calls done, of all calls, and the label of the last one done, "" at first"""


def available_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def call_all(
    function: Callable[..., Any],
    calls: Sequence[tuple[Any, ...]],
    workers: int,
    done: Callable[[int], None] = lambda number: None,
) -> list[Any]:
    """Return what `function` returns for the arguments of each call; `done` hears the number of each that is done.

    Raises what a call raises, and InputError where a worker was killed.
    """
    results: list[Any] = [None] * len(calls)
    with closing(_computed(function, calls, workers)) as computed:
        for number, result in computed:
            results[number] = result
            done(number)
    return results


def _computed(
    function: Callable[..., Any], calls: Sequence[tuple[Any, ...]], workers: int
) -> Generator[tuple[int, Any]]:
    if workers == 1 or not calls:
        yield from ((number, function(*call)) for number, call in enumerate(calls))
        return
    # Not forked: a progress bar's thread may hold a lock at that moment.
    context = multiprocessing.get_context("forkserver")
    with ProcessPoolExecutor(workers, context, initializer=_begin_worker) as pool:
        waiting = {pool.submit(function, *call): number for number, call in enumerate(calls)}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BrokenExecutor:
            raise InputError(
                f"a worker was killed, perhaps because memory was short: use fewer --workers than {workers}. What is "
                "done is kept; the same command goes on there"
            ) from None
        except BaseException:
            # The pool would wait for what it computes, which may take a minute. No future may be cancelled before: a
            # thread of the pool fails at a cancelled one when the workers are gone, and the program never ends.
            pool.shutdown(wait=False)
            for worker in multiprocessing.active_children():
                worker.kill()
            raise


def _begin_worker() -> None:
    # Ctrl-C in a terminal reaches the workers too; they leave it to the process that started them.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
