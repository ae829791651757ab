"""How a command ends: its exit status, and SIGTERM, which ends every verb as Ctrl-C does: LEDs dark, children gone."""

import logging
import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from types import FrameType

from gellight.base.errors import GellightError
from gellight.base.logs import say
from gellight.cli.advice import typeable


class Ending(IntEnum):
    """The exit statuses; `MEANINGS` says what each stands for."""

    DONE = 0
    JUDGED_BAD = 1
    REFUSED = 2
    FAULT = 3
    INTERRUPTED = 128 + signal.SIGINT
    TERMINATED = 128 + signal.SIGTERM


MEANINGS = {
    Ending.DONE: "done; also where Ctrl-C or SIGTERM ended what runs until then (run, demo, ring set, sim, ...)",
    Ending.JUDGED_BAD: "done, and what was judged did not pass (doctor, selfcheck, calibrate)",
    Ending.REFUSED: "not done; the last line says why, and what to do",
    Ending.FAULT: "a fault of GelLight itself, with a traceback: please report it",
    Ending.INTERRUPTED: "ended by Ctrl-C before it was done",
    Ending.TERMINATED: "ended by SIGTERM before it was done",
}


_received: list[int] = []
"""the signals that came"""


def _interrupt(number: int, _: FrameType | None) -> None:
    _received.append(number)
    raise KeyboardInterrupt


def end(command: Callable[[], object]) -> None:
    """Run a command and exit with its status; a `GellightError` is printed in one line."""
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as a shell's background job has it
        signal.signal(signal.SIGINT, _interrupt)
    try:
        command()
    except GellightError as error:
        say(f"gellight: {typeable(str(error))}", level=logging.ERROR)
        sys.exit(_interrupted_or(Ending.REFUSED))
    except KeyboardInterrupt:
        sys.exit(_interrupted_or(Ending.INTERRUPTED))
    except SystemExit as error:
        # typer knows Ctrl-C alone
        sys.exit(_interrupted_or(Ending.INTERRUPTED) if error.code == Ending.INTERRUPTED else error.code)
    except Exception:
        say(traceback.format_exc().rstrip(), level=logging.CRITICAL)
        sys.exit(Ending.FAULT)


def _interrupted_or(status: Ending) -> int:
    return 128 + _received[-1] if _received else status


@contextmanager
def until_interrupted(wanted: bool = True) -> Iterator[None]:
    """Take Ctrl-C or SIGTERM for the proper end of what runs inside, unless not `wanted`."""
    try:
        yield
    except KeyboardInterrupt:
        if not wanted:
            raise
        if sys.stderr.isatty():
            print(file=sys.stderr)  # after the ^C that the terminal shows
