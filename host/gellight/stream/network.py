"""Sessions of zenoh, the transport between programs: who may reach whom, and under which keys.

gellight/<name>/frame    every tactile frame, see wire.py
gellight/<name>/call     questions and commands, see calls.py
gellight/<name>/alive    liveliness: it is there as long as the daemon is
"""

import json
import logging
import os
import socket
import sys
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote, unquote

import zenoh

from gellight.base.errors import StreamError
from gellight.stream import shared_memory

logger = logging.getLogger(__name__)
LAN_PORT = 7447
CONNECT_MS = 3000


def key(name: str, part: str) -> str:
    """Return the key expression of a part of a sensor: frame, call or alive; any name becomes one piece of a key."""
    return f"gellight/{quote(name, safe='')}/{part}"


def name_of(key_expression: str) -> str:
    """Return the name of the sensor that a key belongs to."""
    return unquote(key_expression.split("/")[1])


def publishing_session(*, lan: bool, config: Path | None) -> tuple[zenoh.Session, str]:
    """Open a session that subscribers connect to; return it and its endpoint, a free port of 127.0.0.1.

    lan: accept other machines too, on `LAN_PORT`. config: a file of zenoh's own settings, for TLS and access control.
    Raises StreamError where a port is in use or the file is no configuration of zenoh.
    """
    settings = _settings(config)
    own = f"tcp/127.0.0.1:{_free_port()}"
    said = json.loads(settings.get_json("listen/endpoints"))  # a list where the file says it, else zenoh's own, by mode
    endpoints = [own, *([f"tcp/[::]:{LAN_PORT}"] if lan else []), *(said if isinstance(said, list) else [])]
    return _opened(settings, {"mode": "peer", "listen/endpoints": endpoints, "listen/exit_on_failure": True}), own


def subscribing_session(endpoint: str, *, config: Path | None) -> zenoh.Session:
    """Open a session to the daemon at `endpoint`, such as tcp/127.0.0.1:7447; StreamError where none answers."""
    connect = {"connect/endpoints": [endpoint], "connect/timeout_ms": CONNECT_MS, "connect/exit_on_failure": True}
    return _opened(_settings(config), {"mode": "client", **connect})


def close(session: zenoh.Session) -> None:
    """Close a session."""
    session.close()  # type: ignore[no-untyped-call]  # zenoh does not annotate it


def _settings(config: Path | None) -> zenoh.Config:
    if config is None:
        return zenoh.Config()
    try:
        return zenoh.Config.from_file(str(config))
    except zenoh.ZError as error:
        raise StreamError(f"{config} is no configuration of zenoh ({error}): see docs/streaming.md") from error


def _opened(settings: zenoh.Config, given: Mapping[str, object]) -> zenoh.Session:
    """Open a session with these settings; shared memory is used wherever both sides can."""
    # Without the folder zenoh would open nothing at all, as in some containers and small Linux systems.
    shared = sys.platform != "linux" or os.access(shared_memory.PLACE, os.W_OK)
    if not shared:
        logger.warning("%s cannot be written: frames go through the network, which costs more", shared_memory.PLACE)
    both = {**given, "scouting/multicast/enabled": False, "transport/shared_memory/enabled": shared}
    for name, value in both.items():
        settings.insert_json5(name, json.dumps(value))
    try:
        return zenoh.open(settings)
    except zenoh.ZError as error:
        endpoints = given.get("connect/endpoints") or given["listen/endpoints"]
        raise StreamError(
            f"no connection at {endpoints} ({_first_line(error)}): is the daemon there? has another program the port?"
        ) from error


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


def _first_line(error: Exception) -> str:
    return str(error).split(" at /")[0].splitlines()[0]
