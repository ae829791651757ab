"""Memory that publisher and readers on the same computer share, so that a frame need not go through the network."""

import logging
import os
from collections.abc import Iterable, Sequence

import zenoh
from zenoh import shm

logger = logging.getLogger(__name__)
FRAMES = 8
"""that may be under way at a time"""
PLACE = "/dev/shm"
STEP_BYTES = 1 << 18


class SharedMemory:
    """A pool for messages, made when the first one comes; where there is no room they are sent as they are."""

    def __init__(self) -> None:
        """Start without a pool."""
        self._provider: shm.ShmProvider | None = None
        self._size = 0

    def holding(self, pieces: Sequence[bytes | memoryview]) -> zenoh.ZBytes:
        """Return a message, given in pieces, in shared memory; on its own while all of the memory is in use."""
        size = sum(map(len, pieces))
        if size > self._size:
            self._provider, self._size = _pool(size), size
        if self._provider is None:
            return zenoh.ZBytes(b"".join(pieces))
        try:
            room = self._provider.alloc(size, policy=shm.GarbageCollect(shm.JustAlloc()))
        except zenoh.ZError:  # readers that do not read hold all of it
            return zenoh.ZBytes(b"".join(pieces))
        _write(room, pieces)
        return zenoh.ZBytes(room)


def still_there(message: zenoh.ZBytes) -> bool:
    """Whether what was read of a message until now is the message.

    The memory of a reader that was stopped for 0.1 s or more may be given to the next message.
    """
    shared = message.as_shm()
    return shared is None or shared.is_valid()


def _write(room: shm.ZShmMut, pieces: Iterable[bytes | memoryview]) -> None:
    """Write the pieces one after the other; zenoh takes bytes alone, copied while the cache has them."""
    at = 0
    for piece in pieces:
        for start in range(0, len(piece), STEP_BYTES):
            step = bytes(piece[start : start + STEP_BYTES])
            room[at : at + len(step)] = step
            at += len(step)


def _pool(message_bytes: int) -> shm.ShmProvider | None:
    """Return a pool of shared memory; None where the system has too little: writing to it would end the process."""
    wanted = FRAMES * message_bytes
    try:
        facts = os.statvfs(PLACE)
        if facts.f_bavail * facts.f_frsize < 2 * wanted:
            logger.warning("%s has less than %.0f MB free: frames go through the network", PLACE, 2 * wanted / 1e6)
            return None
        return shm.ShmProvider.default_backend(wanted)
    except (OSError, zenoh.ZError) as error:
        logger.warning("no shared memory (%s): frames go through the network", error)
        return None
