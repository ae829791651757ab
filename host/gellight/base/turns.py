"""A lock whose users take turns: who waits gets it before who has just given it back."""

import threading
from typing import Self


class Turns:
    """A context manager that one thread at a time is in."""

    def __init__(self) -> None:
        """Be free."""
        self._using, self._next_user = threading.Lock(), threading.Lock()

    def __enter__(self) -> Self:
        """Wait for the turn of this thread."""
        with self._next_user:
            self._using.acquire()
        return self

    def __exit__(self, *problem: object) -> None:
        """Give it to who waits."""
        self._using.release()
