"""A mailbox that keeps the latest: what real time needs instead of a queue."""

import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Mailbox(Generic[Item]):
    """Holds the newest item, or the newest `keep` items; each item has a number that grows by one.

    A mailbox of one item may have many readers. One of several items has a single reader, and lets go of what that
    reader has taken: an item may hold memory that others wait for.
    """

    def __init__(self, keep: int = 1, *, lasting: bool = False) -> None:
        """Start empty and open. lasting: `clear` leaves what is there."""
        self._lasting = lasting
        self._changed = threading.Condition()
        self._items: deque[tuple[int, Item]] = deque(maxlen=keep)
        self._number = 0
        self._closed: BaseException | None = None
        self._copies: tuple[Mailbox[Item], ...] = ()

    @property
    def newest(self) -> int:
        """Number of the item that was put last, 0 for none."""
        return self._number

    def put(self, item: Item) -> None:
        """Add an item, which takes the place of the oldest where the mailbox is full, and wake all who wait."""
        with self._changed:
            self._number += 1
            self._items.append((self._number, item))
            self._changed.notify_all()
            copies = self._copies
        for copy in copies:
            copy.put(item)

    def clear(self) -> None:
        """Throw away what is there: nobody is to take it any more, but of copies that say otherwise."""
        with self._changed:
            if not self._lasting:
                self._items.clear()
            copies = self._copies
        for copy in copies:
            copy.clear()

    def close(self, reason: BaseException) -> None:
        """Let everyone who waits from now on raise `reason`; what was put last can still be taken."""
        with self._changed:
            self._closed = self._closed or reason
            self._changed.notify_all()
            copies = self._copies
        for copy in copies:
            copy.close(reason)

    @contextmanager
    def subscribe(self, keep: int, *, lasting: bool = False) -> Iterator["Mailbox[Item]"]:
        """Yield a mailbox that gets every item from now on, for a reader who wants them all and not only the newest.

        It holds `keep` items: a reader who falls farther behind loses the oldest, and slows nobody. lasting: what has
        come stays in it when what is newest is thrown away.
        """
        copy: Mailbox[Item] = Mailbox(keep, lasting=lasting)
        with self._changed:
            self._copies = (*self._copies, copy)
            if self._closed is not None:
                copy.close(self._closed)
        try:
            yield copy
        finally:
            with self._changed:
                self._copies = tuple(other for other in self._copies if other is not copy)

    def take(self, after: int, timeout_s: float) -> tuple[int, Item]:
        """Wait for an item newer than number `after`; return the number and the item, of several the oldest.

        Raises TimeoutError after `timeout_s`, or the reason the mailbox was closed for.
        """
        with self._changed:
            if self._items.maxlen != 1:
                while self._items and self._items[0][0] <= after:
                    self._items.popleft()
            self._changed.wait_for(lambda: self._newer(after) is not None or self._closed is not None, timeout_s)
            found = self._newer(after)
            if found is not None:
                return found
            if self._closed is not None:
                raise self._closed
            raise TimeoutError(f"no frame within {timeout_s:g} s")

    def _newer(self, after: int) -> tuple[int, Item] | None:
        return next((kept for kept in self._items if kept[0] > after), None)
