"""Which threads run first: real-time priority (SCHED_FIFO of Linux), or nice values, one for each thread."""

import getpass
import os
import sys
import threading
from collections.abc import Iterable
from contextlib import suppress
from enum import StrEnum

from gellight.base.errors import InputError

REAL_TIME = 10
"""of 1 to 99; the kernel's own threads for interrupts have 50"""
FIRST, BEHIND = -5, 5
"""nice values; below 0 the system has to allow it (a limit `nice`)"""


class Priority(StrEnum):
    """How camera and reconstruction stand before other threads."""

    REAL_TIME = "real time"
    NICE = "before other programs"
    OTHERS_GIVE_WAY = "before the page and the watch"


def run_first(threads: Iterable[threading.Thread], *, realtime: bool) -> Priority:
    """Give threads that run the best priority that this user may; return it.

    realtime: real-time priority and nothing less; InputError where the system does not allow it, with the remedy.
    """
    if realtime and not hasattr(os, "sched_setscheduler"):
        raise InputError("real-time priority is there on Linux alone: leave out --realtime")
    ids = [thread.native_id or 0 for thread in threads]
    return _real_time(ids) if realtime else _before_others(ids)


def give_way() -> None:
    """Let the calling thread run behind those that `run_first` got."""
    _nice(threading.get_native_id(), BEHIND)


def _real_time(threads: list[int]) -> Priority:
    for thread in threads:
        try:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(REAL_TIME))
        except PermissionError:
            raise InputError(
                f"real-time priority is not allowed here: add the line `{getpass.getuser()} - rtprio {REAL_TIME}` to "
                "/etc/security/limits.conf and log in again, or leave out --realtime"
            ) from None
        except ProcessLookupError:  # it has ended already, and what ended it is raised where frames are waited for
            continue
    return Priority.REAL_TIME


def _before_others(threads: list[int]) -> Priority:
    try:
        for thread in threads:
            _nice(thread, FIRST)
    except PermissionError:
        return Priority.OTHERS_GIVE_WAY
    return Priority.NICE


def _nice(thread: int, value: int) -> None:
    if sys.platform.startswith("linux"):  # elsewhere the value is that of the whole process
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, thread, value)
