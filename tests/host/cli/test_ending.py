"""Exit statuses, and what a verb prints last."""

import signal
import sys
import threading
from collections.abc import Callable

import pytest

from gellight.base.errors import InputError
from gellight.cli import ending
from gellight.cli.ending import MEANINGS, Ending, end, until_interrupted
from tests.helpers.children import run
from tests.helpers.places import CHECKOUT


@pytest.fixture(autouse=True)
def restored(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tests go on handling signals as they did."""
    monkeypatch.setattr(ending, "_received", [])
    monkeypatch.setattr(ending, "_hear_signals", lambda: None)


def raising(error: BaseException) -> Callable[[], None]:
    def command() -> None:
        raise error

    return command


@pytest.mark.parametrize(
    ("command", "status"),
    [
        (raising(SystemExit(1)), Ending.JUDGED_BAD),
        (raising(InputError("no")), Ending.REFUSED),
        (raising(MemoryError()), Ending.REFUSED),
        (raising(ZeroDivisionError()), Ending.FAULT),
        (raising(KeyboardInterrupt()), Ending.INTERRUPTED),
        (raising(SystemExit(130)), Ending.INTERRUPTED),
    ],
)
def test_every_end_has_its_status(command: Callable[[], None], status: int) -> None:
    with pytest.raises(SystemExit) as ended:
        end(command)
    assert ended.value.code == status


@pytest.mark.parametrize("error", [KeyboardInterrupt(), SystemExit(130), InputError("stopped")])
def test_a_termination_is_told_from_ctrl_c(error: BaseException) -> None:
    ending._received.append(signal.SIGTERM)
    with pytest.raises(SystemExit) as ended:
        end(raising(error))
    assert ended.value.code == Ending.TERMINATED == 143


def interrupted_in_a_lock() -> None:
    """A thread that starts waits so for its first step."""
    started = threading.Condition(threading.Lock())
    with started:
        started.release()
        raise KeyboardInterrupt


def releasing_twice() -> None:
    threading.Lock().release()


def test_an_interruption_inside_a_lock_is_one() -> None:
    with until_interrupted():
        interrupted_in_a_lock()
    with pytest.raises(RuntimeError, match="unlocked"), until_interrupted():
        releasing_twice()
    for command, status in ((interrupted_in_a_lock, Ending.INTERRUPTED), (releasing_twice, Ending.FAULT)):
        with pytest.raises(SystemExit) as ended:
            end(command)
        assert ended.value.code == status


def test_what_runs_until_it_is_ended_takes_ctrl_c_for_its_end() -> None:
    with until_interrupted():
        raise KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt), until_interrupted(False):
        raise KeyboardInterrupt


LOST = {
    # No step of Python lies between the signal, which the C library raises, and the wait.
    "before a wait": """
steps = (partial(getattr(ctypes.CDLL(None), "raise"), signal.SIGTERM), partial(time.sleep, 60))
command = partial(list, map(operator.methodcaller("__call__"), steps))
""",
    "in a destructor": """
class Held:
    def __del__(self):
        signal.raise_signal(signal.SIGTERM)
def command():
    Held()
    time.sleep(60)
""",
}


@pytest.mark.parametrize("code", LOST.values(), ids=LOST.keys())
def test_no_signal_is_lost(code: str) -> None:
    imports = "import ctypes, operator, signal, time\nfrom functools import partial\n"
    ended = run(
        [sys.executable, "-c", f"{imports}{code}\nfrom gellight.cli.ending import end\nend(command)"], timeout_s=60
    )
    assert (ended.returncode, ended.stderr) == (Ending.TERMINATED, "")


def test_the_document_and_the_help_list_every_status() -> None:
    text = (CHECKOUT / "docs/commands.md").read_text()
    assert set(MEANINGS) == set(Ending)
    for status, meaning in MEANINGS.items():
        assert f"| {status} | {meaning} |\n" in text
