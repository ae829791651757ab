"""Compute the next item of an iterator in a thread while the caller works on this one."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

Item = TypeVar("Item")


def one_ahead(items: Iterable[Item], give_up: Callable[[], object] = lambda: None) -> Iterator[Item]:
    """Yield the items in their order, and raise where computing one did, after those before it.

    give_up: called at the end, and when the caller wants no more: the thread is waited for, and may end early then.
    """
    left = iter(items)
    with ThreadPoolExecutor(1) as pool:
        try:
            coming = pool.submit(lambda: list(islice(left, 1)))
            while item := coming.result():
                coming = pool.submit(lambda: list(islice(left, 1)))
                yield item[0]
        finally:
            give_up()
