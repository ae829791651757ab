"""A folder for what is simulated, which is gone where nothing came of it."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gellight.base.writing import make_folder


@contextmanager
def new_folder(path: Path) -> Iterator[None]:
    """Make a folder as `make_folder` does; where the block fails, those that it made and left empty are removed."""
    made = [place for place in (path, *path.parents) if not place.exists()]
    make_folder(path)
    try:
        yield
    except BaseException:
        with suppress(OSError):
            for place in made:
                place.rmdir()
        raise
