"""The errors of V4L2 cameras: one for each remedy."""

import errno
import fcntl
import mmap
import os
import select
import time
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import Structure

from gellight.base.errors import INSTALL_UDEV, CameraError
from gellight.base.holders import holders_text

GONE = {errno.ENODEV, errno.ENXIO, errno.ESHUTDOWN}
_DISTURBED = {errno.EIO, errno.EPROTO, errno.EPIPE, errno.ETIMEDOUT, errno.EILSEQ, errno.EOVERFLOW}
"""of a USB transfer that went wrong"""


class UnpluggedError(CameraError):
    """The camera is no longer there; it may come back."""


class StalledError(CameraError):
    """The camera is there, but no usable frame comes."""


class BusyError(CameraError):
    """Another programme uses the camera."""


class DeniedError(CameraError):
    """The user may not open the camera."""


@contextmanager
def explaining(path: str, doing: str) -> Iterator[None]:
    """Raise an OSError of the kernel as the error of this module that names the remedy."""
    try:
        yield
    except OSError as error:
        raise explanation(path, doing, error) from error


def no_camera(path: str) -> str:
    """Return the message for a file that is something else."""
    return f"{path} is no V4L2 camera: `gellight find` lists those that are there"


def explanation(path: str, doing: str, error: OSError) -> CameraError:
    """Return the error that belongs to an errno."""
    if error.errno == errno.ENOENT:
        return UnpluggedError(f"no camera at {path}: plug it in, or let `gellight find` list what is there")
    if error.errno in GONE:
        return UnpluggedError(f"the camera at {path} was unplugged: plug it in again")
    if error.errno == errno.EISDIR:
        return CameraError(no_camera(path))
    if error.errno == errno.EBADF:
        return CameraError(f"the camera at {path} is closed: open it again")
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeniedError(
            f"you may not use {path} ({os.strerror(error.errno)}): run {INSTALL_UDEV}, then unplug the sensor "
            "and plug it in"
        )
    if error.errno == errno.EBUSY:
        return BusyError(f"{path} is in use by {holders_text(path)}: end that programme")
    if error.errno == errno.ENOSPC:
        return CameraError(
            f"the USB bus of {path} has no bandwidth left: use format=MJPG, a lower fps or size, or a port of another "
            "USB controller than the other cameras"
        )
    reason = os.strerror(error.errno) if error.errno else str(error)
    kind = StalledError if error.errno in _DISTURBED else CameraError
    return kind(f"{path} fails {doing} ({reason}): unplug the sensor and plug it in, then try `gellight doctor`")


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
