"""Who waits for a lock comes next, and an interruption leaves nothing locked."""

import threading
from types import SimpleNamespace

import pytest

from gellight.base.fair_lock import FairLock


def test_who_waits_for_the_lock_comes_before_the_one_who_gives_it_back() -> None:
    lock, order = FairLock(), []

    def other() -> None:
        with lock:
            order.append("other")

    thread = threading.Thread(target=other)
    with lock, lock:
        thread.start()
        while not lock._next.locked():
            pass
    with lock:
        order.append("again")
    thread.join()
    assert order == ["other", "again"]


def test_an_interruption_just_after_the_lock_was_taken_gives_it_back() -> None:
    """As a handler of Ctrl-C raises it."""
    lock = FairLock()
    inner = lock._lock

    def interrupted() -> None:
        inner.acquire()
        raise KeyboardInterrupt

    lock._lock = SimpleNamespace(acquire=interrupted, release=inner.release)  # type: ignore[assignment]
    with pytest.raises(KeyboardInterrupt):
        lock.__enter__()
    lock._lock = inner
    free = []
    thread = threading.Thread(target=lambda: free.append(inner.acquire(timeout=5)))
    thread.start()
    thread.join()
    assert free == [True]
