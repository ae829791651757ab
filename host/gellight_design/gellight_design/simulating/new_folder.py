"""A folder for what is simulated, which is gone where nothing came of it."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gellight.base.errors import InputError
from gellight.base.writing import make_folder
from sim_reference.deformation import NotConverged


@contextmanager
def new_folder(path: Path, what: str) -> Iterator[None]:
    """Make a folder; where the block fails, those that were made for it and are empty are removed.

    Raises InputError where `what` cannot be simulated or written.
    """
    made = [place for place in (path, *path.parents) if not place.exists()]
    try:
        make_folder(path)
        yield
    except BaseException as error:
        with suppress(OSError):
            for place in made:
                place.rmdir()
        if isinstance(error, ValueError | NotConverged):
            raise InputError(f"this {what} cannot be simulated: {error}") from error
        if isinstance(error, OSError):
            raise InputError(
                f"the {what} cannot be written to {path} ({error.strerror}): choose another --out"
            ) from error
        raise
