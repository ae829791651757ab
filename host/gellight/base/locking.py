"""Locks: on files, given back by the system when the process that holds one ends; and between threads, by turns.

Windows locks one byte far behind the content, so that the content can still be read.
"""

import os
import threading
from contextlib import suppress
from typing import IO, Any, Self

try:
    import fcntl
except ImportError:  # Windows
    import msvcrt

    _windows: Any = msvcrt  # its types are known on Windows alone
    _FAR = 1 << 30

    def _call(handle: IO[str], mode: int) -> bool:
        """Lock or unlock the byte; return whether that went well."""
        descriptor = handle.fileno()
        place = os.lseek(descriptor, 0, os.SEEK_CUR)
        try:
            os.lseek(descriptor, _FAR, os.SEEK_SET)
            _windows.locking(descriptor, mode, 1)
        except OSError:
            return False
        finally:
            os.lseek(descriptor, place, os.SEEK_SET)
        return True

    def lock(handle: IO[str]) -> bool:
        """Lock a file as long as it is open; return False where another process has locked it."""
        return _call(handle, _windows.LK_NBLCK)

    def is_locked(handle: IO[str]) -> bool:
        """Return whether another process has locked a file."""
        if not _call(handle, _windows.LK_NBLCK):
            return True
        _call(handle, _windows.LK_UNLCK)
        return False
else:

    def _flock(handle: IO[str], mode: int) -> bool:
        try:
            fcntl.flock(handle, mode | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    def lock(handle: IO[str]) -> bool:
        """Lock a file as long as it is open; return False where another process has locked it."""
        return _flock(handle, fcntl.LOCK_EX)

    def is_locked(handle: IO[str]) -> bool:
        """Return whether another process has locked a file; else nobody can, until it is closed."""
        return not _flock(handle, fcntl.LOCK_SH)


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
