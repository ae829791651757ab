"""Who has a device open, by a folder like /proc."""

import os
from pathlib import Path

import pytest

from gellight.base.holders import holders, holders_text


@pytest.fixture
def proc(tmp_path: Path) -> Path:
    """Two processes have the device open, one of which has no name any more; a third has something else open."""
    for number, target in (("12", "device"), ("7", "device"), ("9", "other")):
        (tmp_path / "proc" / number / "fd").mkdir(parents=True)
        (tmp_path / "proc" / number / "fd" / "3").symlink_to(tmp_path / target)
    for number in ("12", "9"):
        (tmp_path / "proc" / number / "comm").write_text("cheese\n")
    (tmp_path / "proc" / "12" / "fd" / "4").symlink_to(tmp_path / "device")
    return tmp_path / "proc"


def test_everyone_who_has_it_open_is_named_once_by_number(proc: Path, tmp_path: Path) -> None:
    assert holders(tmp_path / "device", proc=proc) == [(7, "unknown"), (12, "cheese")]
    assert holders_text(tmp_path / "device", proc=proc) == "unknown (process 7), cheese (process 12)"


@pytest.mark.parametrize(("times", "words"), [(1, "this user may not see"), (2, "itself, which has it open twice")])
def test_where_nobody_else_is_seen_it_is_this_program_or_one_that_hides(tmp_path: Path, times: int, words: str) -> None:
    own = tmp_path / str(os.getpid()) / "fd"
    own.mkdir(parents=True)
    for number in range(times):
        (own / str(number)).symlink_to(tmp_path / "device")
    assert words in holders_text(tmp_path / "device", proc=tmp_path)
