"""This process: what systemd is told of it, and the memory of large arrays, given back as soon as they are gone."""

import ctypes
import os
import socket
import sys

M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8
"""of `mallopt`, glibc's malloc.h"""
ARENAS = 2
"""else each of some twenty threads keeps its own"""
LARGE_BYTES = 1 << 20
"""smaller than any map of a picture"""


class ServiceManager:
    """The manager that started this process, where there is one (`sd_notify` of systemd); else nobody is told."""

    def __init__(self) -> None:
        """Find the manager's socket, which the environment names."""
        address = os.environ.get("NOTIFY_SOCKET", "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._frames = -1

    def ready(self) -> None:
        """Say that the service works from now on."""
        self._tell("READY=1")

    def alive(self, frames: int, *, away: bool) -> None:
        """Say that the service lives, if it does: frames have come since, or the sensor is known to be away.

        frames: until now. A service that says nothing for as long as its unit file allows is started anew.
        """
        if away or frames != self._frames:
            self._frames = frames
            self._tell("WATCHDOG=1")

    def _tell(self, message: str) -> None:
        if self._address:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
                wire.sendto(message.encode(), self._address)


def give_back_large_arrays() -> None:
    """Let the C library take large arrays from the system one by one; a no-op where it is not glibc.

    Else it learns from the first that is freed to keep up to 32 MB of such memory in the arena of each thread, in
    pieces that no later array fits.
    """
    if sys.platform != "linux":
        return
    c_library = ctypes.CDLL(None)
    if hasattr(c_library, "mallopt"):
        c_library.mallopt(M_MMAP_THRESHOLD, LARGE_BYTES)
        c_library.mallopt(M_ARENA_MAX, ARENAS)
