"""A program of another user of this computer, who knows the ports and nothing else: `python -m tests.helpers.stranger`.

It gives up root where the tests run as root, else it is the same user without token and files. It prints what it
reached, as JSON.
"""

import asyncio
import concurrent.futures.thread  # noqa: F401  (as the next one)
import encodings.idna  # noqa: F401  (root's files cannot be read later)
import http.client
import json
import os
import sys
import time
import traceback
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import aiohttp

from gellight.stream.network import close, key, subscribing_session
from gellight.stream.subscription import subscribe
from tests.helpers import children

NOBODY = 65534
FALSE = b"a false frame"
KEYS = ("gellight/finger/{}", "gellight/*/{}", "gellight/f$*/{}", "*/finger/{}", "gel$*/**", "**")
"""by which the daemon's own can be meant"""


def as_stranger(attack: str, *arguments: str) -> Any:
    """Return what a stranger reaches by `attack`, one of the functions below."""
    done = children.run([sys.executable, "-m", "tests.helpers.stranger", attack, *arguments])
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def speaks(endpoint: str, ready: str, ended: str) -> list[str]:
    """Publish false frames, notes and lives, and answer calls, until the file `ended` is there; tell what was asked."""
    session, asked = subscribing_session(endpoint, config=None), list[str]()
    parts = [one.format(part) for one in KEYS for part in ("frame", "note", "alive", "call")]
    held: list[object] = [
        session.declare_queryable(one, lambda query: asked.append(str(query.attachment)), complete=True)
        for one in parts
    ]
    tokens = [session.liveliness().declare_token(key("finger", "alive"))]
    time.sleep(0.5)
    tokens.clear()  # which withdraws it
    Path(ready).touch()
    while not Path(ended).exists():
        for one in parts:
            session.put(one, FALSE)
            session.delete(one)
        time.sleep(0.02)
    held.clear()
    close(session)
    return asked


def calls(endpoint: str) -> list[str]:
    """Ask for what changes something, as a program without a token does, and read a frame."""
    said = []
    with subscribe(endpoint.replace("tcp/", "zenoh://") + "/finger") as frames:
        said.append(str(frames.next_frame().contact.area_mm2 > 0))
        for one in (frames.zero, lambda: frames.press("BALL", 1.0), lambda: frames.light(None)):
            try:
                one()
                said.append("done")
            except Exception as error:
                said.append(str(error))
    return said


def flood(endpoint: str) -> list[str]:
    """Send 300 calls of 2 MB without a pause, and 300 small ones; return what the last was told."""
    session, told = subscribing_session(endpoint, config=None), list[str]()

    def note(reply: Any) -> None:
        told.append("answered" if reply.ok else reply.err.payload.to_string())

    for size in (2_000_000, 0):
        for _ in range(300):
            session.get(key("finger", "call"), note, payload=b'{"type": "calibration"}' + b" " * size, timeout=60)
    time.sleep(5)
    close(session)
    return sorted(set(told))


def files(*paths: str) -> list[str]:
    return [_tried(lambda path=path, how=how: Path(path).open(how).close()) for path in paths for how in ("rb", "r+b")]  # type: ignore[misc]


def views(url: str) -> list[str]:
    """Open Foxglove's door as a program: what the server offers, and what it says to a message of a client's own."""

    async def look() -> list[str]:
        async with aiohttp.ClientSession() as client, client.ws_connect(url, protocols=["foxglove.sdk.v1"]) as wire:
            offered = (await wire.receive_json())["capabilities"]
            topic = {"id": 1, "topic": "/gellight/contact", "encoding": "json", "schemaName": ""}
            for sent in (
                {"op": "advertise", "channels": [topic]},
                {"op": "setParameters", "parameters": [{"name": "zero", "value": 1}]},
            ):
                await wire.send_json(sent)
            await wire.send_bytes(b"\x01\1\0\0\0" + FALSE)
            told = dict[str, Any]()
            while told.get("op") != "advertise" and told.get("op") != "status":
                told = await wire.receive_json()
            return [*offered, told["op"]]

    return asyncio.run(asyncio.wait_for(look(), 30))


def browses(*ports: str) -> list[str]:
    """Send what a web page may send, to doors that speak no HTTP."""
    pages = [f"http://127.0.0.1:{port}/" for port in ports]
    asked = [urllib.request.Request(page, b"{}", {"Origin": "http://evil.example"}) for page in pages]
    return [_tried(lambda one=one: urllib.request.urlopen(one, timeout=1).status) for one in asked]  # type: ignore[misc]


def page(base: str) -> list[str]:
    """Ask a page for everything there is, and for the zero."""
    zero = urllib.request.Request(base + "command", b'{"type": "zero"}', {"Content-Type": "application/json"})
    asked = [zero, *(base + path for path in ("", "status", "metrics", "health", "calibration", "ws"))]
    return [_tried(lambda one=one: urllib.request.urlopen(one).status) for one in asked]  # type: ignore[misc]


def _tried(work: Callable[[], object]) -> str:
    try:
        return str(work())
    except http.client.HTTPException:
        return "no HTTP"
    except urllib.error.HTTPError as error:
        return str(error.code)
    except OSError as error:
        return type(error).__name__


if __name__ == "__main__":
    if os.getuid() == 0:  # after all is imported: where the interpreter lies is root's
        os.setgroups([])
        os.setgid(NOBODY)
        os.setuid(NOBODY)
    os.environ.pop("XDG_RUNTIME_DIR", None)
    os.environ["XDG_STATE_HOME"] = "/nonexistent"
    try:
        print(json.dumps(globals()[sys.argv[1]](*sys.argv[2:])), flush=True)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)  # zenoh's threads may wait for each other at the end
