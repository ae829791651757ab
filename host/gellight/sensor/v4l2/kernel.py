"""The system calls of capture. Tests put a fake kernel in their place; nothing else in this room calls the system."""

import fcntl
import mmap
import os
import select
import time
from ctypes import Structure

POLL_IN, POLL_ERROR = select.POLLIN, select.POLLERR | select.POLLHUP | select.POLLNVAL


class Kernel:
    """Linux. Every call raises OSError with the errno of the kernel."""

    def open(self, path: str) -> int:
        """Open for reading and writing without blocking; return the descriptor."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        """Hand `argument` to the driver, which may change it; Python repeats a call that a signal interrupts."""
        fcntl.ioctl(descriptor, request, argument)

    def mmap(self, descriptor: int, length: int, offset: int) -> mmap.mmap:
        """Map a buffer of the driver for reading."""
        return mmap.mmap(descriptor, length, mmap.MAP_SHARED, mmap.PROT_READ, offset=offset)

    def poll(self, descriptor: int, timeout_s: float) -> int:
        """Wait for a picture or a fault; return the events as of poll(2), 0 after `timeout_s`."""
        poller = select.poll()
        poller.register(descriptor, select.POLLIN)
        found = poller.poll(max(timeout_s, 0.0) * 1e3)
        return found[0][1] if found else 0

    def close(self, descriptor: int) -> None:
        """Close the descriptor."""
        os.close(descriptor)

    def clock(self) -> float:
        """CLOCK_MONOTONIC, s: the clock of the time stamps."""
        return time.monotonic()


LINUX = Kernel()
