"""Real-time priority: threads that run as soon as they can, before every program without it (SCHED_FIFO of Linux)."""

import getpass
import os
import threading
from collections.abc import Iterable

from gellight.base.errors import InputError

PRIORITY = 10
"""of 1 to 99; the kernel's own threads for interrupts have 50"""


def run_first(threads: Iterable[threading.Thread]) -> None:
    """Give threads that run real-time priority; InputError where the system does not allow it, with the remedy."""
    if not hasattr(os, "sched_setscheduler"):
        raise InputError("real-time priority is there on Linux alone: leave service.realtime out")
    for thread in threads:
        try:
            os.sched_setscheduler(thread.native_id or 0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        except PermissionError:
            raise InputError(
                f"real-time priority is not allowed here: add the line `{getpass.getuser()} - rtprio {PRIORITY}` to "
                "/etc/security/limits.conf and log in again, or leave service.realtime out"
            ) from None
        except ProcessLookupError:  # it has ended already, and what ended it is raised where frames are waited for
            continue
