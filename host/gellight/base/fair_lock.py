"""A lock whose users take turns."""

import threading
from contextlib import suppress
from typing import Self


class FairLock:
    """A re-entrant lock: a thread that waits for it gets it before the one that gives it back can take it again."""

    def __init__(self) -> None:
        """Make a lock that nobody holds."""
        self._next, self._lock = threading.Lock(), threading.RLock()
        self._owner: int | None = None
        self._depth = 0

    def __enter__(self) -> Self:
        """Wait for the lock."""
        me = threading.get_ident()
        if self._owner != me:
            try:
                with self._next:
                    self._lock.acquire()
            except BaseException:  # Ctrl-C may come when it has just been taken
                with suppress(RuntimeError):  # it was not
                    self._lock.release()
                raise
            self._owner = me
        self._depth += 1
        return self

    def __exit__(self, *_: object) -> None:
        """Give it back."""
        self._depth -= 1
        if not self._depth:
            self._owner = None
            self._lock.release()
