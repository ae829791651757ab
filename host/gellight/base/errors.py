"""The errors of the host. Every message says what was wrong, with which value, and what to do about it.

Among them: that a package is missing which not every user has.
"""

from collections.abc import Iterator
from contextlib import contextmanager

INSTALL_UDEV = "`sudo $(command -v gellight) install-udev` once"
"""what lets a user use the sensor; sudo does not search the PATH of a virtual environment"""


class GellightError(Exception):
    """Base of all errors that a user or a program can cause or cure; the command line exits with status 2."""


class InputError(GellightError):
    """A file, an image or an argument is not what it has to be."""


class CameraError(GellightError):
    """The camera cannot be opened, or stopped delivering frames."""


class BundleError(GellightError):
    """A calibration bundle is damaged, incomplete, of a newer schema, or made for another sensor."""


class TrainingError(GellightError):
    """GelNet cannot be trained on the given presses, or its export differs from what was trained."""


class ConfigError(GellightError):
    """A configuration file has an unknown key or a value out of range."""


class ServerError(GellightError):
    """The dashboard cannot be served (for example: the port is in use)."""


class StreamError(GellightError):
    """Frames cannot be published or received, or what was received is no frame of this version."""


class BoardError(GellightError):
    """The board of the light ring cannot be reached, speaks another protocol, or refuses what was asked."""


def first_line(error: Exception) -> str:
    """Return the first line of what another library's error says, or its name where it says nothing.

    Of the operating system's errors it is the reason alone: who reads it was told which file, and needs no number.
    """
    said = (isinstance(error, OSError) and error.strerror) or str(error).strip()
    return (said or type(error).__name__).splitlines()[0]


def printable(name: object) -> str:
    """Return the name of a file with U+FFFD for what is no UTF-8, so that it can be drawn, stored and sent."""
    return str(name).encode(errors="surrogateescape").decode(errors="replace")


@contextmanager
def needed(remedy: str, kind: type[GellightError] = InputError) -> Iterator[None]:
    """Import a package inside: an error of `kind` says the remedy where it is missing, else why it does not load."""
    try:
        yield
    except ModuleNotFoundError:
        raise kind(remedy) from None
    except ImportError as error:  # as where no memory is left
        raise kind(f"a package is there and cannot be loaded: {first_line(error)}") from error
