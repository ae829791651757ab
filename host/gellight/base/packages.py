"""Packages that not every user has."""

from collections.abc import Iterator
from contextlib import contextmanager

from gellight.base.errors import GellightError, InputError, first_line


@contextmanager
def needed(remedy: str, kind: type[GellightError] = InputError) -> Iterator[None]:
    """Import a package inside: an error of `kind` says the remedy where it is missing, else why it does not load."""
    try:
        yield
    except ModuleNotFoundError:
        raise kind(remedy) from None
    except ImportError as error:  # as where no memory is left
        raise kind(f"a package is there and cannot be loaded: {first_line(error)}") from error
