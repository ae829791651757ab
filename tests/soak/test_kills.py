"""Processes are killed, stopped and left without room while they write: what is there is old or new."""

from pathlib import Path

import pytest

from tests.soak.kills import DONE, REFUSED, Blow, Faults, did, table, without_growth
from tests.soak.writers import Writer, prepare, writers

pytestmark = pytest.mark.nightly

FAULTS = 20


def test_what_is_written_under_faults_is_old_or_new_and_the_next_start_works(tmp_path: Path) -> None:
    drawn = Faults(1, tmp_path)
    for _ in range(FAULTS):
        drawn.one()
    assert all(one.passed == one.tried for one in drawn.tallies.values()), table(drawn.tallies)


def in_place(home: Path) -> None:
    (home / "file").write_bytes(b"new" * 100_000)


def silent(home: Path) -> None:
    try:
        in_place(home)
    except OSError:
        return


def judge(home: Path) -> None:
    assert (home / "file").read_bytes() in (b"old", b"new" * 100_000)


def refused_without_a_place(home: Path) -> None:
    try:
        in_place(home)
    except OSError as error:
        (home / "file").write_bytes(b"old")
        raise OSError("no") from error


@pytest.mark.parametrize("act", [in_place, silent, refused_without_a_place])
def test_a_weakness_that_was_planted_is_found(act, tmp_path: Path) -> None:
    def begin(home: Path) -> None:
        (home / "file").write_bytes(b"old")

    drawn = Faults(1, tmp_path, lambda _: (Writer("planted", begin, act, judge),), (Blow.NO_LARGER_FILE,))
    for _ in range(5):
        drawn.one()
    broken = drawn.tallies["planted", Blow.NO_LARGER_FILE].broken
    assert broken, table(drawn.tallies)


@pytest.mark.parametrize("kind", ["hdf5", "video", "npz"])
def test_an_export_without_room_is_refused_in_words_and_leaves_nothing(kind: str, tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    prepare(tmp_path)
    (export,) = (writer for writer in writers(tmp_path) if writer.name == f"exporting {kind}")
    status, said = did(lambda: without_growth(export, tmp_path / "home", 300))
    assert (status, str(tmp_path / "home/out") in said) == (REFUSED, True), said
    assert not (tmp_path / "home/out").exists()
    assert did(lambda: export.act(tmp_path / "home"))[0] == DONE
