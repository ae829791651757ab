"""Which daemons of this user publish on this computer: one small file each, locked as long as its daemon lives.

    $XDG_RUNTIME_DIR/gellight/<name>.json    who publishes, and where; else in the user's state folder

The system gives the lock back when the daemon ends, however it ends: a file that is not locked is of a daemon that is
gone.
"""

import json
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO
from urllib.parse import quote

from pydantic import ValidationError

from gellight.base.allowed import StrictModel
from gellight.base.errors import StreamError
from gellight.base.locking import is_locked, lock
from gellight.base.runtime_folder import folder

MOST_BYTES = 4096  # chosen: a daemon's file is a line of JSON
MOST_TRIES = 200  # chosen: daemons of one name on a computer


class RunningDaemon(StrictModel):
    """A daemon that publishes the frames of one sensor."""

    name: str
    """of the sensor"""
    endpoint: str
    """where subscribers connect to, as zenoh writes it: `tcp/127.0.0.1:PORT`"""
    sensor: str
    """URL that it was opened with"""
    memory: str
    """of its frames, see shared_memory.py; empty where there is none"""
    token: str = ""
    """what a program brings that changes something; the file is its owner's alone"""
    process: int
    since_unix_s: float
    session: int = 0
    """what all programs that were started from one terminal have in common; 0: not known"""
    page: str = ""
    """address of its page, with the token; empty where there is none"""


@contextmanager
def announced(
    name: str, endpoint: str, sensor: str, *, memory: str = "", token: str = "", page: str = "", numbered: bool
) -> Iterator[RunningDaemon]:
    """Announce the daemon of this process under `name`, as long as the context lasts.

    numbered: where another one has the name, take NAME-2, NAME-3, ...: there may be several, as of simulated sensors.
    Else StreamError says who has it.
    """
    handle, free = _locked(name, numbered)
    with handle:
        daemon = RunningDaemon(
            name=free,
            endpoint=endpoint,
            sensor=sensor,
            memory=memory,
            token=token,
            process=os.getpid(),
            since_unix_s=time.time(),
            session=_session(),
            page=page,
        )
        os.fchmod(handle.fileno(), 0o600)  # the token is its owner's, whatever the folder allows
        handle.truncate(0)
        handle.write(daemon.model_dump_json())
        handle.flush()
        try:
            yield daemon
        finally:
            _place(free).unlink(missing_ok=True)


def running() -> list[RunningDaemon]:
    """Return the daemons that publish now, by name."""
    return [daemon for path in sorted(folder().glob("*.json")) if (daemon := _read(path)) is not None]


def default_daemon(daemons: Sequence[RunningDaemon]) -> RunningDaemon | None:
    """Return the daemon that was started last from this terminal, else the only one; None where that is not told."""
    here = [daemon for daemon in daemons if daemon.session and daemon.session == _session()]
    newest = max(here, key=lambda daemon: daemon.since_unix_s, default=None)
    if newest is None:
        return daemons[0] if len(daemons) == 1 else None
    return newest if [daemon.process for daemon in here].count(newest.process) == 1 else None


def _session() -> int:
    return os.getsid(0) if hasattr(os, "getsid") else 0


def _place(name: str) -> Path:
    return folder() / f"{quote(name, safe='').replace('.', '%2E')}.json"


def _locked(name: str, numbered: bool) -> tuple[TextIO, str]:
    """Return the locked file of a name that nobody has, and the name."""
    folder().mkdir(mode=0o700, parents=True, exist_ok=True)
    tried, number = name, 1
    for _ in range(MOST_TRIES):
        handle = _place(tried).open("a+")
        if lock(handle) and _same(handle, _place(tried)):
            return handle, tried
        handle.close()
        holder = _read(_place(tried))
        if holder is None:  # its daemon begins or ends in this moment
            time.sleep(0.01)
        elif numbered:
            number += 1
            tried = f"{name}-{number}"
        else:
            raise StreamError(_taken(holder))
    raise StreamError(
        f"{_place(tried)} is locked, and no daemon: end the program that holds it, or set another stream.name"
    )


def _same(handle: TextIO, path: Path) -> bool:
    """Whether the file that was opened still is the one of that name: it may have been removed before it was locked."""
    try:
        return os.fstat(handle.fileno()).st_ino == path.stat().st_ino
    except FileNotFoundError:
        return False


def _taken(holder: RunningDaemon) -> str:
    minutes = (time.time() - holder.since_unix_s) / 60
    return (
        f"sensor {holder.name} is published already by process {holder.process}, for {minutes:.0f} minutes "
        f"({holder.sensor}): stop that one, or give this one another stream.name"
    )


def _read(path: Path) -> RunningDaemon | None:
    """Return the daemon of a file; None where it is gone or has not written the file yet."""
    try:
        with path.open("r") as handle:
            if is_locked(handle):
                return RunningDaemon.model_validate(json.loads(handle.read(MOST_BYTES)))
    except (OSError, ValueError, RecursionError, ValidationError):
        pass
    return None
