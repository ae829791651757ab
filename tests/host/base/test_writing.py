"""What is written survives a loss of power: flushed, renamed, its folder flushed; a target at every moment."""

import errno
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from unittest.mock import Mock

import pytest

from gellight.base import writing
from gellight.base.writing import check_place, make_folder, whole, write_file, write_folder

Step = tuple[str, str]


class Disk:
    """Carries out what is asked of the disk, and notes its order; looks at `target` before and after each step."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.steps: list[Step] = []
        self.sizes: dict[str, int] = {}
        """bytes of each file when it was flushed"""
        self.look: Callable[[], object] = lambda: None
        for name in ("rename", "replace"):
            monkeypatch.setattr(os, name, self._noting(name, getattr(os, name)))
        monkeypatch.setattr(writing, "_rename_exchange", self._noting("exchange", writing._rename_exchange))
        flush = os.fsync

        def fsync(handle: int) -> None:
            place = Path(f"/proc/self/fd/{handle}").readlink()
            self.sizes[place.name] = place.stat().st_size
            self._do(("flush", place.name), lambda: flush(handle))

        monkeypatch.setattr(os, "fsync", fsync)

    def _noting(self, name: str, carry_out: Callable[..., object]) -> Callable[..., object]:
        def noting(one: str | Path | bytes, other: str | Path | bytes) -> object:
            return self._do((name, Path(os.fsdecode(other)).name), lambda: carry_out(one, other))

        return noting

    def _do(self, step: Step, carry_out: Callable[[], object]) -> object:
        self.look()
        result = carry_out()
        self.steps.append(step)
        self.look()
        return result


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


def plain(steps: list[Step]) -> list[Step]:
    """The steps with one name for every partial file."""
    return [(what, "partial" if name.endswith(".partial") else name) for what, name in steps]


def test_a_file_is_flushed_before_it_is_renamed_and_its_folder_after(tmp_path: Path, disk: Disk) -> None:
    place = tmp_path / "state.json"
    place.write_bytes(b"old")
    seen = set()
    disk.look = lambda: seen.add(place.read_bytes())
    write_file(place, b"the new one")
    assert plain(disk.steps) == [("flush", "partial"), ("replace", "state.json"), ("flush", tmp_path.name)]
    assert 11 in disk.sizes.values(), "it was flushed after the last byte was written"
    assert seen == {b"old", b"the new one"}
    assert place.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("old", ["folder", "file", "link"])
def test_a_folder_takes_the_place_of_what_was_there_in_one_step(tmp_path: Path, disk: Disk, old: str) -> None:
    target = tmp_path / "bundle"
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    {"folder": target.mkdir, "file": target.touch, "link": lambda: target.symlink_to(elsewhere)}[old]()
    disk.look = lambda: os.stat(target)  # noqa: PTH116  (raises where there is nothing)
    write_folder(target, {"a": b"1", "b": b"22"})
    assert plain(disk.steps) == [
        ("flush", "a"),
        ("flush", "b"),
        ("flush", "partial"),
        ("exchange", "bundle"),
        ("flush", tmp_path.name),
    ]
    assert (disk.sizes["a"], disk.sizes["b"]) == (1, 2)
    assert {path.name: path.read_bytes() for path in target.iterdir()} == {"a": b"1", "b": b"22"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bundle", "elsewhere"]


def test_a_new_folder_and_those_above_it_are_flushed(tmp_path: Path, disk: Disk) -> None:
    write_folder(tmp_path / "one" / "two" / "bundle", {"a": b"1"})
    assert plain(disk.steps) == [
        ("flush", tmp_path.name),
        ("flush", "one"),
        ("flush", "a"),
        ("flush", "partial"),
        ("rename", "bundle"),
        ("flush", "two"),
    ]


def test_where_two_folders_cannot_be_exchanged_the_old_one_steps_aside(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "_rename_exchange", Mock(side_effect=OSError(errno.EINVAL, os.strerror(errno.EINVAL))))
    target = tmp_path / "bundle"
    write_folder(target, {"a": b"old"})
    write_folder(target, {"a": b"new"})
    assert (target / "a").read_bytes() == b"new"
    assert [path.name for path in tmp_path.iterdir()] == ["bundle"]
    assert [what for what, _ in disk.steps[-5:]] == ["flush", "rename", "rename", "flush", "flush"]


@pytest.mark.parametrize("number", range(5))
def test_a_disk_that_fails_anywhere_loses_nothing(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    target = tmp_path / "bundle"
    write_folder(target, {"a": b"old", "b": b"old"})
    disk.steps.clear()

    def fail() -> None:
        if len(disk.steps) == number:
            raise OSError(errno.EIO, os.strerror(errno.EIO))

    disk.look = fail
    with pytest.raises(OSError, match="Input/output error"):
        write_folder(target, {"a": b"new", "b": b"new"})
    assert {path.read_bytes() for path in target.iterdir()} == {b"old" if number < 4 else b"new"}
    assert [path.name for path in tmp_path.iterdir()] == ["bundle"]


def test_a_file_system_that_cannot_flush_a_folder_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flush = os.fsync

    def refuse_folders(handle: int) -> None:
        if Path(f"/proc/self/fd/{handle}").readlink().is_dir():
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        flush(handle)

    monkeypatch.setattr(os, "fsync", refuse_folders)
    write_file(tmp_path / "a", b"1")
    assert (tmp_path / "a").read_bytes() == b"1"


def test_a_folder_that_another_program_makes_at_the_same_time_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make = Path.mkdir

    def late(path: Path, **how: bool) -> None:
        if not path.exists():
            make(path)
        make(path, **how)

    monkeypatch.setattr(Path, "mkdir", late)
    make_folder(tmp_path / "one" / "two")
    assert (tmp_path / "one" / "two").is_dir()


def test_a_place_is_tried_without_leaving_anything(tmp_path: Path) -> None:
    check_place(tmp_path / "new/folder/file")
    check_place(Path("file"))
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").touch()
    for place in (tmp_path / "file/below", Path("/proc/below")):
        with pytest.raises(OSError):  # noqa: PT011 -- systems give several reasons
            check_place(place)
    with pytest.raises(FileExistsError):
        make_folder(tmp_path / "file")


def test_what_a_library_writes_gets_its_name_when_it_is_whole_and_is_gone_where_it_is_not(tmp_path: Path) -> None:
    with whole(tmp_path / "a.h5") as partial:
        partial.write_bytes(b"a")
        assert not (tmp_path / "a.h5").exists()
    with whole(tmp_path / "b") as partial:
        partial.mkdir()
    for name in ("a.h5", "new"):
        with pytest.raises(RuntimeError), whole(tmp_path / name) as partial:  # noqa: PT012
            partial.write_bytes(b"half")
            raise RuntimeError
    with whole(tmp_path / "nothing"):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.h5", "b"]
    assert (tmp_path / "a.h5").read_bytes() == b"a", "the old one stays where the new one could not be finished"


def test_what_a_killed_process_left_is_removed_and_what_another_one_writes_is_not(tmp_path: Path) -> None:
    left = tmp_path / ".a.h5.abcdefgh.partial"
    left.mkdir()
    (left / "a.h5").write_bytes(b"half")
    with whole(tmp_path / "a.h5") as first:
        first.write_bytes(b"first")
        assert not left.exists()
        with whole(tmp_path / "a.h5") as second:
            second.write_bytes(b"second")
        assert first.read_bytes() == b"first"


def test_several_write_one_folder_at_once(tmp_path: Path) -> None:
    def write(number: int) -> None:
        for _ in range(100):
            write_folder(tmp_path / "bundle", {"a": b"x" * 100, "b": bytes([number])})

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(write, range(3)))
    assert [path.name for path in tmp_path.iterdir()] == ["bundle"]
