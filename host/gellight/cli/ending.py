"""How a command ends: its exit status, its last line, and SIGTERM, which ends every verb as Ctrl-C does.

LEDs are dark then, and children gone.
"""

import logging
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from types import FrameType

from gellight.base.errors import GellightError, first_line
from gellight.base.logs import say


class Ending(IntEnum):
    """The exit statuses; `MEANINGS` says what each stands for."""

    DONE = 0
    JUDGED_BAD = 1
    REFUSED = 2
    FAULT = 3
    INTERRUPTED = 128 + signal.SIGINT
    TERMINATED = 128 + signal.SIGTERM


MEANINGS = {
    Ending.DONE: "done",
    Ending.JUDGED_BAD: "finished, but a check failed",
    Ending.REFUSED: "not done, the last line says why",
    Ending.FAULT: "a fault of GelLight, please report it",
    Ending.INTERRUPTED: "ended by Ctrl-C before it was done",
    Ending.TERMINATED: "ended by SIGTERM before it was done",
}


REMIND_S = 0.05
"""a signal whose handler has not run by then is brought to mind"""
_received: list[int] = []
"""the signals that came"""
_looks = 0
"""how often the main thread has looked for signals that came"""


def _interrupt(number: int, _: FrameType | None) -> None:
    _look()
    _received.append(number)
    raise KeyboardInterrupt


def _look(*_: object) -> None:
    global _looks
    _looks += 1


def _hear_signals() -> None:
    """Have SIGTERM and Ctrl-C interrupt the main thread wherever it is.

    Python looks for signals between its own steps. One that comes after its last look before a system call that waits
    would be noticed when that wait is over: a thread interrupts the wait by another signal. A handler's error that is
    raised inside a destructor or a callback of a weak reference is lost: the thread sends the signal again.
    """
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as a shell's background job has it
        signal.signal(signal.SIGINT, _interrupt)
    if not hasattr(signal, "pthread_kill"):  # Windows, where waits notice Ctrl-C
        return
    signal.signal(signal.SIGURG, _look)
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    show = sys.unraisablehook

    def unraisable(lost: "sys.UnraisableHookArgs") -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt):
            os.write(writing, bytes([0]))
        else:
            show(lost)

    sys.unraisablehook = unraisable
    threading.Thread(target=_remind, args=(reading,), name="signals", daemon=True).start()


def _remind(reading: int) -> None:
    """Let the main thread notice each signal whose number comes through the pipe; 0: its interruption was lost."""
    main, seen = threading.main_thread().ident, 0
    assert main is not None
    while number := os.read(reading, 1):
        time.sleep(REMIND_S)
        if number[0] == 0:
            signal.pthread_kill(main, _received[-1])
        while number[0] in (signal.SIGINT, signal.SIGTERM) and _looks == seen:
            signal.pthread_kill(main, signal.SIGURG)
            time.sleep(REMIND_S)
        seen = _looks


def end(command: Callable[[], object]) -> None:
    """Run a command and exit with its status; a `GellightError` is printed in one line."""
    _hear_signals()
    try:
        command()
    except GellightError as error:
        say(f"gellight: {error}", level=logging.ERROR)
        sys.exit(_interrupted_or(Ending.REFUSED))
    except MemoryError as error:
        what = first_line(error)
        say(
            f"gellight: this computer has no memory left ({what}): end other programs, and try again",
            level=logging.ERROR,
        )
        sys.exit(_interrupted_or(Ending.REFUSED))
    except KeyboardInterrupt:
        sys.exit(_interrupted_or(Ending.INTERRUPTED))
    except SystemExit as error:
        # typer knows Ctrl-C alone
        sys.exit(_interrupted_or(Ending.INTERRUPTED) if error.code == Ending.INTERRUPTED else error.code)
    except Exception as error:
        if _is_interruption(error):
            sys.exit(_interrupted_or(Ending.INTERRUPTED))
        say(traceback.format_exc().rstrip(), level=logging.CRITICAL)
        sys.exit(Ending.FAULT)


def _interrupted_or(status: Ending) -> int:
    return 128 + _received[-1] if _received else status


def _is_interruption(error: BaseException | None) -> bool:
    """Say whether a signal ended it; inside Python's own locks its interruption ends as "release unlocked lock"."""
    if isinstance(error, RuntimeError):
        return _is_interruption(error.__context__)
    return isinstance(error, KeyboardInterrupt)


@contextmanager
def until_interrupted(wanted: bool = True) -> Iterator[None]:
    """Take Ctrl-C or SIGTERM for the proper end of what runs inside, unless not `wanted`."""
    try:
        yield
    except (KeyboardInterrupt, RuntimeError) as error:
        if not (wanted and _is_interruption(error)):
            raise
        if sys.stderr.isatty():
            print(file=sys.stderr)  # after the ^C that the terminal shows
