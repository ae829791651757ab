"""The system calls of capture. Tests put a fake kernel in their place; nothing else in the package calls the system."""

import fcntl
import mmap
import os
import select
import time
from ctypes import Structure
from typing import Protocol

POLL_IN, POLL_ERROR = select.POLLIN, select.POLLERR | select.POLLHUP | select.POLLNVAL


class Memory(Protocol):
    """Memory shared with the driver."""

    def __getitem__(self, part: slice, /) -> bytes:
        """Copy a part."""

    def close(self) -> None:
        """Unmap."""


class Kernel(Protocol):
    """What capture asks of the system. Every call raises OSError with the errno of the kernel."""

    def open(self, path: str) -> int:
        """Open for reading and writing without blocking; return the descriptor."""

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        """Hand `argument` to the driver, which may change it."""

    def mmap(self, descriptor: int, length: int, offset: int) -> Memory:
        """Map a buffer of the driver for reading."""

    def poll(self, descriptor: int, timeout_s: float) -> int:
        """Wait until the device has something to say; return the events as of poll(2), 0 after `timeout_s`."""

    def close(self, descriptor: int) -> None:
        """Close the descriptor."""

    def clock(self) -> float:
        """CLOCK_MONOTONIC, s: the clock of the time stamps."""


class LinuxKernel:
    """The real one."""

    def open(self, path: str) -> int:
        """Open for reading and writing without blocking."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        """Hand `argument` to the driver; an interrupted call is repeated by Python."""
        fcntl.ioctl(descriptor, request, argument)

    def mmap(self, descriptor: int, length: int, offset: int) -> Memory:
        """Map a buffer of the driver for reading."""
        return mmap.mmap(descriptor, length, mmap.MAP_SHARED, mmap.PROT_READ, offset=offset)

    def poll(self, descriptor: int, timeout_s: float) -> int:
        """Wait for a frame or a fault."""
        poller = select.poll()
        poller.register(descriptor, select.POLLIN)
        found = poller.poll(max(timeout_s, 0.0) * 1e3)
        return found[0][1] if found else 0

    def close(self, descriptor: int) -> None:
        """Close the descriptor."""
        os.close(descriptor)

    def clock(self) -> float:
        """CLOCK_MONOTONIC, s."""
        return time.monotonic()
