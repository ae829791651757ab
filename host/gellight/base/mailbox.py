"""A mailbox that keeps the latest: what real time needs instead of a queue."""

import threading
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Mailbox(Generic[Item]):
    """Holds the newest item only; each item has a number that grows by one."""

    def __init__(self) -> None:
        """Start empty and open."""
        self._changed = threading.Condition()
        self._item: Item | None = None
        self._number = 0
        self._closed: BaseException | None = None

    def put(self, item: Item) -> None:
        """Replace what is there and wake all who wait."""
        with self._changed:
            self._item = item
            self._number += 1
            self._changed.notify_all()

    def clear(self) -> None:
        """Throw away what is there: nobody is to take it any more."""
        with self._changed:
            self._item = None

    def close(self, reason: BaseException) -> None:
        """Let everyone who waits from now on raise `reason`; what was put last can still be taken."""
        with self._changed:
            self._closed = self._closed or reason
            self._changed.notify_all()

    def take(self, after: int, timeout_s: float) -> tuple[int, Item]:
        """Wait for an item newer than number `after`; return its number and it.

        Raises TimeoutError after `timeout_s`, or the reason the mailbox was closed for.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: (self._number > after and self._item is not None) or self._closed is not None, timeout_s
            )
            if self._number > after and self._item is not None:
                return self._number, self._item
            if self._closed is not None:
                raise self._closed
            raise TimeoutError(f"no frame within {timeout_s:g} s")
