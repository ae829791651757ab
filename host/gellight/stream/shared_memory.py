"""Frames for readers on the same computer: memory that the publisher writes and that its readers map.

The memory has PLACES places, which are filled in turn, and before them a table with the number of the message in each.
A reader gets a note over the network: where the message lies and its number. The publisher clears the number of a place
long before it writes there, one frame ahead; a reader copies the message and then compares the number, so it never
takes a message that was written over meanwhile.

The memory is a file without a name (Linux), which programs of the same user open through /proc. It is gone with the
last program that uses it, however that ends, and needs no room in /dev/shm. Zenoh's own shared memory is not used: a
reader keeps the memory of every publisher that it ever met, locked, until the reader ends.
"""

import mmap
import os
import struct
import threading
from collections.abc import Sequence
from pathlib import Path

from gellight.base.errors import StreamError

PLACES = 16
"""messages that a reader may be behind"""
NAME = "gellight-frames"
NOTE = struct.Struct("<QQQ")
"""where the message begins, its bytes, its number"""
NUMBER = struct.Struct("<Q")


class OverwrittenError(Exception):
    """The message has made room for a newer one."""


def _number(places: mmap.mmap, message: int, number: int) -> None:
    """Set the number of the place of a message."""
    NUMBER.pack_into(places, message % PLACES * NUMBER.size, number)


class _Mapped:
    """A file and the map of it, which is made when it is needed."""

    def __init__(self, file: int) -> None:
        self._file = file
        self._map: mmap.mmap | None = None

    def _map_anew(self, size: int, access: int) -> mmap.mmap:
        self._unmap()
        self._map = mmap.mmap(self._file, size, access=access)
        return self._map

    def _unmap(self) -> None:
        if self._map is not None:
            self._map.close()

    def close(self) -> None:
        """Give the memory back; others keep what they have mapped."""
        self._unmap()
        os.close(self._file)


class FrameMemory(_Mapped):
    """The publisher's side."""

    def __init__(self) -> None:
        """Make memory that is still empty; OSError where the system cannot."""
        if not hasattr(os, "memfd_create"):
            raise OSError("files without a name are Linux's")
        super().__init__(os.memfd_create(NAME))
        os.fchmod(self._file, 0o600)
        self.path = f"/proc/{os.getpid()}/fd/{self._file}"
        self._place_bytes = 0
        self._number = 0

    def write(self, pieces: Sequence[bytes | memoryview]) -> bytes:
        """Write a message, given in pieces; return the note of it. OSError where the system has too little memory."""
        size = sum(map(len, pieces))
        places = self._with_room(size)
        self._number += 1
        _number(places, self._number + 1, 0)
        end = begin = mmap.PAGESIZE + self._number % PLACES * self._place_bytes
        for piece in pieces:
            places[end : end + len(piece)] = piece
            end += len(piece)
        _number(places, self._number, self._number)
        return NOTE.pack(begin, size, self._number)

    def _with_room(self, size: int) -> mmap.mmap:
        """Return table and places, made larger where a message needs it."""
        if self._map is None or size > self._place_bytes:
            place_bytes = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
            whole = mmap.PAGESIZE + PLACES * place_bytes
            # Now rather than page by page: a page that is not to be had later would end the process.
            os.posix_fallocate(self._file, 0, whole)
            places, self._place_bytes = self._map_anew(whole, mmap.ACCESS_WRITE), place_bytes
            for place in range(PLACES):
                _number(places, place, 0)
            return places
        return self._map


class MappedMemory(_Mapped):
    """A reader's side."""

    def __init__(self, path: str) -> None:
        """Open the memory at `FrameMemory.path`; OSError where it is not there, or not ours."""
        if not str(Path(path).readlink()).startswith(f"/memfd:{NAME} "):
            raise OSError(f"{path} is no memory of frames")
        super().__init__(os.open(path, os.O_RDONLY | os.O_CLOEXEC))
        self._using, self._closed = threading.RLock(), False

    def read(self, note: bytes) -> bytes:
        """Return the message of a note, or the note itself where it is the message, for which there was no memory.

        Raises OverwrittenError where it has made room, StreamError where the note points beyond the memory.
        """
        if len(note) != NOTE.size:
            return note
        at, size, number = NOTE.unpack(note)
        with self._using:
            places = self._holding(at + size)
            self._expect(places, number)  # who is late already would be later still for a copy in vain
            message = places[at : at + size]
            self._expect(places, number)
            return message

    def close(self) -> None:
        """Give the memory back, when nobody reads it."""
        with self._using:
            super().close()
            self._closed = True

    @staticmethod
    def _expect(places: mmap.mmap, number: int) -> None:
        if NUMBER.unpack_from(places, number % PLACES * NUMBER.size)[0] != number:
            raise OverwrittenError

    def _holding(self, end: int) -> mmap.mmap:
        """Return the places, mapped anew where they have grown."""
        if self._closed:
            raise StreamError("the subscription was closed")
        if self._map is None or len(self._map) < end:
            there = os.fstat(self._file).st_size
            if there < end:
                raise StreamError(f"the daemon names byte {end} of a memory of {there}: is it of this version?")
            return self._map_anew(there, mmap.ACCESS_READ)
        return self._map
