"""Files and folders that are written whole or not at all, and that a loss of power does not take back.

A file is written beside its place and flushed to the disk (fsync), then it is renamed to its place, then the folder
that holds its name is flushed. So the old content or the new one is there at every moment, and the new one after the
call has returned.
"""

import ctypes
import errno
import glob
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # linux/fcntl.h and linux/fs.h: from the working folder; both names change places
_CANNOT = {errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP}
"""what a file system answers to a request that it does not know"""


def write_file(path: Path, content: bytes) -> None:
    """Write a file that may exist.

    Raises OSError. Then the file is as before; only where the folder could not be flushed the new content may be there.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent)
    partial = Path(name)
    try:
        _fill(handle, content)
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    _flush_folder(path.parent)


def write_folder(target: Path, files: Mapping[str, bytes]) -> None:
    """Write a folder of these files; an old folder, file or link of that name is replaced in one step.

    Some file systems (NFS among them) cannot exchange two folders in one step. There the old one is renamed to
    `.NAME.*.old` first, so a loss of power between two renames leaves it under that name. Raises OSError as
    `write_file` does.
    """
    make_folder(target.parent)
    with _beside(target) as partial:
        partial.chmod(0o755)
        for name, content in files.items():
            _fill(os.open(partial / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), content)
        _flush_folder(partial)
        there = os.path.lexists(target)
        if not there:
            try:
                partial.rename(target)
            except OSError:
                there = os.path.lexists(target)  # another one has written it in this moment
                if not there:
                    raise
        if there:
            _exchange(partial, target)
        _flush_folder(target.parent)


def check_place(path: Path) -> None:
    """Raise OSError unless something can be written at `path`, whose folder may be missing; leave nothing there."""
    folder = path.absolute().parent
    while not os.path.lexists(folder):
        folder = folder.parent
    with tempfile.TemporaryFile(dir=folder):
        pass


def make_folder(path: Path) -> None:
    """Make a folder, and those above it that are missing; raises OSError."""
    missing = [place for place in (path, *path.parents) if not place.exists()]
    for place in reversed(missing):
        place.mkdir(exist_ok=True)
        _flush_folder(place.parent)
    path.mkdir(exist_ok=True)  # an error of its own where something else has that name


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Yield a place where a library may write the file or folder `path`, which gets its name once the block is done.

    Where the block fails, or writes nothing, nothing is left. A file is flushed to the disk; of a folder only its name
    is. Raises OSError.
    """
    make_folder(path.parent)
    with _beside(path) as beside:
        partial = beside / path.name
        yield partial
        if partial.is_file():
            with partial.open("rb+") as stream:
                os.fsync(stream.fileno())
        if partial.exists():
            partial.rename(path)
            _flush_folder(path.parent)


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """Make a folder beside `target` that is removed; so are those that a killed process left for the same target."""
    for old in target.parent.glob(f".{glob.escape(target.name)}.*.partial"):
        with suppress(OSError), _held(old):
            _remove(old)
    with ExitStack() as stack:
        partial = _new_beside(target, stack)
        try:
            yield partial
        finally:
            _remove(partial)


def _new_beside(target: Path, stack: ExitStack) -> Path:
    """Make and hold a folder; until it is held, another writer may take it for one that a killed process left."""
    while True:
        partial = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".partial", dir=target.parent))
        with suppress(BlockingIOError, FileNotFoundError):
            stack.enter_context(_held(partial))
            if partial.exists():
                return partial


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Hold a folder as long as the process lives; OSError where another one holds it."""
    import fcntl  # Windows, where only readers of streams run, has none

    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def _fill(handle: int, content: bytes) -> None:
    """Write the content of a new file, flush it and close it."""
    with os.fdopen(handle, "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fchmod(handle, 0o644)
        os.fsync(handle)


def _flush_folder(path: Path) -> None:
    """Flush the names in a folder to the disk, where its file system can do that."""
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
    finally:
        os.close(handle)


def _exchange(partial: Path, target: Path) -> None:
    """Let two existing names change places."""
    try:
        _rename_exchange(os.fsencode(partial), os.fsencode(target))
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
        _step_aside(partial, target)


def _rename_exchange(one: bytes, other: bytes) -> None:
    """Exchange two names in one step, as Linux can; OSError (ENOSYS) where the C library cannot."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    if rename(_AT_FDCWD, one, _AT_FDCWD, other, _RENAME_EXCHANGE) != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def _step_aside(partial: Path, target: Path) -> None:
    old = partial.with_suffix(".old")
    target.rename(old)
    try:
        partial.rename(target)
    except OSError:
        old.rename(target)
        raise
    _flush_folder(target.parent)
    _remove(old)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
