"""Runs in the guest: does what the tests on the machine ask, each call in a process of its own.

There are two lines to the machine, so that the world can change (a cable be plugged in) while a long call runs.

A call is one line of JSON, `{"call": "module:function", "arguments": {...}, "limit_s": 20}`. While the function runs it
may report events; the last line of the answer holds its result, or the traceback of what it raised.
"""

import importlib
import json
import os
import signal
import socket
import sys
import time
import traceback
from typing import Any, TextIO

PRELOADED = (
    "tests.vm.inside.plugging",
    "tests.vm.inside.looking",
    "tests.vm.inside.commanding",
    "tests.vm.inside.sensing",
)
"""imported once, before the first call: it takes seconds in an emulated machine"""
MACHINE = "10.0.2.2"
"""the machine, seen from the guest"""
_answers: TextIO


def report(event: str, **facts: Any) -> None:
    """Tell the waiting test that something has happened."""
    print(json.dumps({"event": event, **facts}, default=str), file=_answers, flush=True)


def perform(call: dict[str, Any]) -> None:
    """Run the function in this process and write its answer."""
    module, _, name = call["call"].partition(":")
    try:
        result = getattr(importlib.import_module(module), name)(**call["arguments"])
        answer = {"result": result}
    except BaseException:
        answer = {"error": traceback.format_exc()}
    print(json.dumps(answer, default=str), file=_answers, flush=True)


def preload(modules: list[str]) -> None:
    """Import modules in this process, so that every later call has them."""
    for name in modules:
        importlib.import_module(name)
    print(json.dumps({"result": None}), file=_answers, flush=True)


def supervise(call: dict[str, Any]) -> None:
    """Run a call in a child; one that does not end, or ends without an answer, is told as an error."""
    child = os.fork()
    if not child:
        perform(call)
        os._exit(0)
    end = time.monotonic() + call["limit_s"]
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            if status:
                print(
                    json.dumps({"error": f"the process of the call ended with status {status}"}),
                    file=_answers,
                    flush=True,
                )
            return
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    print(json.dumps({"error": f"{call['call']} did not end within {call['limit_s']} s"}), file=_answers, flush=True)


def main() -> None:
    """Serve both lines until the machine hangs up."""
    for name in PRELOADED:
        importlib.import_module(name)
    if os.fork():
        serve("main")
    else:
        serve("aside")


def serve(line: str) -> None:
    """Connect to the machine and do what comes over this line."""
    global _answers
    connection = socket.create_connection((MACHINE, int(sys.argv[1])))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    requests, _answers = connection.makefile("r"), connection.makefile("w")
    report("ready", line=line, uptime_s=time.monotonic())
    for request in requests:
        call = json.loads(request)
        if "preload" in call:
            preload(call["preload"])
        else:
            supervise(call)


if __name__ == "__main__":
    # Modules that call `report` must find this very module, not a second copy of it.
    sys.modules["tests.vm.inside.agent"] = sys.modules["__main__"]
    main()
