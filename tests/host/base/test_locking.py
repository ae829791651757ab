"""Locks: of processes (Windows' calls are stood in for by the same locks of this system), and of threads in turn."""

import os
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from gellight.base.holders import holders, holders_text
from gellight.base.locking import FairLock
from tests.helpers import children

AS_ON_WINDOWS = """
import fcntl, os, sys, types

def locking(descriptor, mode, size):
    place = os.lseek(descriptor, 0, os.SEEK_CUR)
    assert place > 10**6, "the content must stay free"
    fcntl.flock(descriptor, fcntl.LOCK_UN if mode == 0 else fcntl.LOCK_EX | fcntl.LOCK_NB)

sys.modules["msvcrt"] = types.SimpleNamespace(LK_UNLCK=0, LK_NBLCK=2, locking=locking)
for name in ("fcntl", "termios", "tty", "pty", "resource", "pwd", "grp", "syslog"):
    sys.modules[name] = None
"""
LINUX_POLL = ("poll", "POLLIN", "POLLERR", "POLLHUP", "POLLNVAL")
HOLD = """
import sys
from gellight.base.locking import lock
handle = open(sys.argv[1], "a+")
print(lock(handle), flush=True)
sys.stdin.read()
"""
ASK = """
import sys
from gellight.base.locking import is_locked, lock
with open(sys.argv[1]) as handle:
    print(is_locked(handle), is_locked(handle), handle.read())
with open(sys.argv[1], "a+") as handle:
    print(lock(handle))
"""


@pytest.mark.parametrize("system", ["", AS_ON_WINDOWS], ids=["here", "Windows"])
def test_a_lock_is_held_until_its_process_ends(tmp_path: Path, system: str) -> None:
    path = tmp_path / "a.json"
    path.write_text("content")

    def ask() -> list[str]:
        return children.run([sys.executable, "-c", system + ASK, path], check=True).stdout.split()

    with children.started([sys.executable, "-c", system + HOLD, path], stdin=-1, stdout=-1, text=True) as holder:
        assert holder.stdout.readline() == "True\n"
        assert ask() == ["True", "True", "content", "False"]
        holder.kill()
        holder.wait()
        assert ask() == ["False", "False", "content", "True"]


def test_verbs_are_imported_without_what_windows_lacks() -> None:
    loaded = "import asyncio, select, subprocess, typer\n"  # what finds out by itself which system this is
    code = f"{loaded}{AS_ON_WINDOWS}\nfor name in {LINUX_POLL}: delattr(select, name)\n"
    code += "from gellight.cli import demo, export, record, run, status"
    done = children.run([sys.executable, "-c", code])
    assert done.returncode == 0, done.stderr


def test_who_waits_for_the_lock_comes_before_the_one_who_gives_it_back() -> None:
    lock, order = FairLock(), []

    def other() -> None:
        with lock:
            order.append("other")

    thread = threading.Thread(target=other)
    with lock, lock:
        thread.start()
        while not lock._next.locked():
            pass
    with lock:
        order.append("again")
    thread.join()
    assert order == ["other", "again"]


def test_an_interruption_just_after_the_lock_was_taken_gives_it_back() -> None:
    """As a handler of Ctrl-C raises it."""
    lock = FairLock()
    inner = lock._lock

    def interrupted() -> None:
        inner.acquire()
        raise KeyboardInterrupt

    lock._lock = SimpleNamespace(acquire=interrupted, release=inner.release)  # type: ignore[assignment]
    with pytest.raises(KeyboardInterrupt):
        lock.__enter__()
    lock._lock = inner
    free = []
    thread = threading.Thread(target=lambda: free.append(inner.acquire(timeout=5)))
    thread.start()
    thread.join()
    assert free == [True]


def test_everyone_who_has_it_open_is_named_once_by_number(tmp_path: Path) -> None:
    """Two processes have the device open, one of which has no name any more; a third has something else open."""
    for number, target in (("12", "device"), ("7", "device"), ("9", "other")):
        (tmp_path / "proc" / number / "fd").mkdir(parents=True)
        (tmp_path / "proc" / number / "fd" / "3").symlink_to(tmp_path / target)
    for number in ("12", "9"):
        (tmp_path / "proc" / number / "comm").write_text("cheese\n")
    (tmp_path / "proc" / "12" / "fd" / "4").symlink_to(tmp_path / "device")
    assert holders(tmp_path / "device", proc=tmp_path / "proc") == [(7, "unknown"), (12, "cheese")]
    assert holders_text(tmp_path / "device", proc=tmp_path / "proc") == "unknown (process 7), cheese (process 12)"


@pytest.mark.parametrize(("times", "words"), [(1, "this user may not see"), (2, "itself, which has it open twice")])
def test_where_nobody_else_is_seen_it_is_this_program_or_one_that_hides(tmp_path: Path, times: int, words: str) -> None:
    own = tmp_path / str(os.getpid()) / "fd"
    own.mkdir(parents=True)
    for number in range(times):
        (own / str(number)).symlink_to(tmp_path / "device")
    assert words in holders_text(tmp_path / "device", proc=tmp_path)
