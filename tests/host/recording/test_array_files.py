"""What HDF5 is told where a disk refuses: nothing, for its library ends the process; afterwards the first error is."""

import errno
import os
from pathlib import Path
from unittest.mock import Mock

import pytest

from gellight.recording.array_files import _Patient

FULL, BROKEN = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), OSError(errno.EIO, os.strerror(errno.EIO))


@pytest.mark.parametrize(("write", "truncate", "told"), [(FULL, BROKEN, FULL), (None, BROKEN, BROKEN)])
def test_the_first_refusal_of_the_disk_is_the_one_that_is_told(
    write: OSError | None, truncate: OSError, told: OSError, tmp_path: Path
) -> None:
    stream = _Patient(tmp_path / "a.h5")
    stream._file = Mock(write=Mock(side_effect=[write or 3]), truncate=Mock(side_effect=truncate))
    assert (stream.write(b"abc"), stream.truncate(7), stream.truncate()) == (3, 7, 0)
    with pytest.raises(OSError, match=told.strerror or ""):
        stream.check()
    with pytest.raises(OSError, match=told.strerror or ""):
        stream.__exit__()


def test_what_could_not_be_written_is_read_as_zeros(tmp_path: Path) -> None:
    stream, place = _Patient(tmp_path / "a.h5"), bytearray(b"xxxxx")
    assert stream.write(b"ab") == 2
    assert (stream.seek(0), stream.readinto(place), stream.tell(), bytes(place)) == (0, 5, 2, b"ab\0\0\0")
