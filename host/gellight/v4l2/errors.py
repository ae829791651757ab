"""What can be wrong with a V4L2 camera, told apart because the cure differs."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gellight.errors import CameraError

GONE = {errno.ENODEV, errno.ENXIO, errno.ESHUTDOWN}
_DISTURBED = {errno.EIO, errno.EPROTO, errno.EPIPE, errno.ETIMEDOUT, errno.EILSEQ, errno.EOVERFLOW}
"""what USB says of a transfer that went wrong"""


class UnpluggedError(CameraError):
    """The camera is no longer there; it may come back."""


class StalledError(CameraError):
    """The camera is there, but no usable frame comes."""


class BusyError(CameraError):
    """Another programme uses the camera."""


class DeniedError(CameraError):
    """The user may not open the camera."""


@contextmanager
def told(path: str, doing: str) -> Iterator[None]:
    """Turn an OSError of the kernel into the error of this module that says what to do."""
    try:
        yield
    except OSError as error:
        raise explained(path, doing, error) from error


def explained(path: str, doing: str, error: OSError) -> CameraError:
    """Return the error that belongs to an errno."""
    if error.errno == errno.ENOENT:
        return UnpluggedError(f"no camera at {path}: plug it in, or let `gellight find` list what is there")
    if error.errno in GONE:
        return UnpluggedError(f"the camera at {path} was unplugged: plug it in again")
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeniedError(
            f"you may not use {path} ({os.strerror(error.errno)}): run `sudo gellight install-udev` once, then unplug "
            "the sensor and plug it in"
        )
    if error.errno == errno.EBUSY:
        return BusyError(f"{path} is in use by {holders_text(path)}: end that programme")
    reason = os.strerror(error.errno) if error.errno else str(error)
    kind = StalledError if error.errno in _DISTURBED else CameraError
    return kind(f"{path} fails {doing} ({reason}): unplug the sensor and plug it in, then try `gellight doctor`")


def holders(path: str | Path, *, proc: Path = Path("/proc")) -> list[tuple[int, str]]:
    """Return process number and command of everyone else who has a device open, as far as this user may see."""
    target = os.path.realpath(path)
    found = []
    for folder in sorted(proc.glob("[0-9]*"), key=lambda place: int(place.name)):
        if int(folder.name) != os.getpid() and _has_open(folder / "fd", target):
            found.append((int(folder.name), _command(folder)))
    return found


def holders_text(path: str | Path, *, proc: Path = Path("/proc")) -> str:
    """Return in words who has a device open."""
    found = holders(path, proc=proc)
    if found:
        return ", ".join(f"{command} (process {number})" for number, command in found)
    return (
        "a programme that this user may not see (`sudo gellight doctor` names it)" if os.getuid() else "this programme"
    )


def _has_open(folder: Path, target: str) -> bool:
    try:
        return any(str(entry.readlink()) == target for entry in folder.iterdir())
    except OSError:  # another user's process, or one that has just ended
        return False


def _command(folder: Path) -> str:
    try:
        return (folder / "comm").read_text().strip()
    except OSError:
        return "unknown"
