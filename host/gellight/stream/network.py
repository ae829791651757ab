"""Sessions of zenoh, the transport between programs: who may reach whom, and under which keys.

gellight/<name>/frame    every tactile frame, see wire.py
gellight/<name>/note     where the same frame lies, for readers on this computer, see shared_memory.py
gellight/<name>/call     questions and commands, see calls.py
gellight/<name>/alive    liveliness: it is there as long as the daemon is
"""

import json
import re
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote, urlsplit

import zenoh

from gellight.base.errors import StreamError, first_line

LAN_PORT, LAN_PORTS = 7447, 16
"""where daemons listen for other computers: the first free one of this number of ports"""
SCOUT_S = 1.5
"""time that daemons of other computers have to answer; zenoh asks at once and again after a second"""
CONNECT_MS = 3000  # chosen: who does not answer within it does not listen
READ_ONLY = {
    "id": "only the daemon speaks", "flows": ["ingress"], "permission": "deny",
    "key_exprs": ["**"],  # all of them: whoever declares `**` is asked for gellight/NAME/call too
    "messages": ["put", "delete", "declare_queryable", "reply", "liveliness_token"],
}  # fmt: skip
"""what who connects may not do: pose as the daemon. Denial goes before whatever a file of zenoh's settings allows"""


def key(name: str, part: str) -> str:
    """Return the key expression of a part of a sensor, such as frame; any name becomes one piece of a key."""
    return f"gellight/{quote(name, safe='')}/{part}"


def name_of(key_expression: str) -> str:
    """Return the name of the sensor that a key belongs to."""
    return unquote(key_expression.split("/")[1])


def publishing_session(*, lan: bool, config: Path | None, lan_port: int = LAN_PORT) -> tuple[zenoh.Session, str]:
    """Open a session that subscribers connect to; return it and its endpoint, a free port of 127.0.0.1.

    lan: accept other machines too, on `lan_port`, and answer who looks for daemons by multicast. config: a file of
    zenoh's own settings, for TLS and access control. Who connects can read and ask, and neither publish nor answer.
    Raises StreamError where a port is in use or the file is no configuration of zenoh.
    """
    settings = zenoh_settings(config)
    own = f"tcp/127.0.0.1:{_free_port()}"
    said = json.loads(settings.get_json("listen/endpoints"))  # a list where the file says it, else zenoh's own, by mode
    endpoints = [own, *([f"tcp/[::]:{lan_port}"] if lan else []), *(said if isinstance(said, list) else [])]
    given = {"mode": "peer", "listen/endpoints": endpoints, "listen/exit_on_failure": True,
             "access_control": _read_only(json.loads(settings.get_json("access_control")))}  # fmt: skip
    alone: dict[str, list[str]] = {"router": [], "peer": []}  # found by others, and connecting to nobody
    found = {"scouting/multicast/enabled": True, "scouting/multicast/autoconnect": alone} if lan else {}
    return opened_session(settings, {**given, **found}), own


def _read_only(said: Mapping[str, Any]) -> Mapping[str, object]:
    """Return the access control that a file says, or none, with `READ_ONLY` for all."""
    mine, everyone = {"rules": [READ_ONLY["id"]], "subjects": ["everyone"]}, {"id": "everyone"}
    rest = said if said["enabled"] else {"default_permission": "allow"}
    added = {"rules": READ_ONLY, "subjects": everyone, "policies": mine}
    return {**rest, "enabled": True, **{name: [*(rest.get(name) or []), one] for name, one in added.items()}}


def free_lan_port() -> int:
    """Return the first port for other computers that is free: several daemons may share them; else StreamError."""
    for port in range(LAN_PORT, LAN_PORT + LAN_PORTS):
        with suppress(OSError), socket.create_server(("", port)):
            return port
    raise StreamError(
        f"the ports {LAN_PORT} to {LAN_PORT + LAN_PORTS - 1} are all in use: stop what uses them, or run "
        "without stream.lan"
    )


def found_by_multicast() -> list[str]:
    """Return an endpoint of each program of zenoh that answers on the local network; not all need be daemons."""
    settings = zenoh.Config()
    settings.insert_json5("scouting/multicast/enabled", "true")
    found: dict[str, str] = {}
    scout = zenoh.scout(what="peer", config=settings)
    try:
        until_s = time.monotonic() + SCOUT_S
        while (left_s := until_s - time.monotonic()) > 0:
            hello = scout.try_recv()
            if hello is None:
                time.sleep(min(left_s, 0.02))
                continue
            outside = [endpoint for endpoint in map(str, hello.locators) if not is_loopback(endpoint)]
            # IPv6 addresses of one link cannot be used without naming the network card.
            for endpoint in sorted(outside, key=lambda text: "[fe80" in text.lower()):
                found.setdefault(str(hello.zid), endpoint)
    finally:
        scout.stop()  # type: ignore[no-untyped-call]  # zenoh does not annotate it
    return sorted(found.values())


def is_loopback(endpoint: str) -> bool:
    """Whether an endpoint, such as tcp/127.0.0.1:7447, is of this computer alone."""
    host = urlsplit(f"//{endpoint.partition('/')[2]}").hostname or ""
    return host in ("::1", "localhost") or host.startswith("127.")


def subscribing_session(endpoint: str, *, config: Path | None) -> zenoh.Session:
    """Open a session to the daemon at `endpoint`, such as tcp/127.0.0.1:7447; StreamError where none answers."""
    connect = {"connect/endpoints": [endpoint], "connect/timeout_ms": CONNECT_MS, "connect/exit_on_failure": True}
    return opened_session(zenoh_settings(config), {"mode": "client", **connect})


def close(session: zenoh.Session) -> None:
    """Close a session."""
    session.close()  # type: ignore[no-untyped-call]  # zenoh does not annotate it


def zenoh_settings(config: Path | None) -> zenoh.Config:
    """Return zenoh's own settings, those of a file where one is given; StreamError for what is none."""
    if config is None:
        return zenoh.Config()
    try:
        config.read_bytes()  # zenoh tells of a missing file by a place in its own source
        return zenoh.Config.from_file(str(config))
    except OSError as error:
        raise StreamError(f"{config} cannot be read ({error.strerror}): check the name") from None
    except zenoh.ZError as error:
        raise StreamError(f"{config} is no configuration of zenoh ({_reason(error)}): see docs/streaming.md") from None


def _reason(error: zenoh.ZError) -> str:
    """Return what zenoh says without places in its source: where a file is wrong, else the first line."""
    place = re.search(r"--> (\d+):(\d+)", str(error))
    return f"line {place[1]}, column {place[2]}" if place else first_line(error).split(" at /")[0]


def opened_session(settings: zenoh.Config, given: Mapping[str, object]) -> zenoh.Session:
    """Open a session with these settings, without zenoh's shared memory (see shared_memory.py); else StreamError."""
    own = {"scouting/multicast/enabled": False, **given, "transport/shared_memory/enabled": False}
    try:
        for name, value in own.items():
            settings.insert_json5(name, json.dumps(value))
        return zenoh.open(settings)
    except zenoh.ZError as error:
        endpoints = given.get("connect/endpoints") or given["listen/endpoints"]
        raise StreamError(
            f"no connection at {endpoints} ({_reason(error)}): is the daemon there? has another program the port?"
        ) from error


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])
