"""What the guest does while `gellight run` runs: asks its dashboard for the status, as a browser does. Runs there."""

import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Any

from gellight.base.runtime_folder import own_token
from tests.vm.inside.agent import report
from tests.vm.inside.sensing import gellight

PORT = 8420
ASK_S = 0.1


def run_through(arguments: list[str]) -> dict[str, Any]:
    """Run `gellight run` and report its status when it streams, when the sensor is away, and when it is back."""
    client = threading.Thread(target=_follow, daemon=True)
    client.start()
    found = gellight(["run", *arguments, "--port", str(PORT)])
    client.join(5)
    return found


def _follow() -> None:
    report("streaming", status=_await(lambda status: status["frames"] >= 1))
    noticed = _await(lambda status: status["camera"]["connection"] == "reconnecting")
    time.sleep(0.5)
    report("away", first=noticed, later=_await(lambda status: "reconnecting" in str(status["error"])))
    report("back", status=_await(lambda status: status["camera"]["connection"] == "connected"), at_s=time.monotonic())


def _await(condition: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    while not condition(status := _status()):
        time.sleep(ASK_S)
    return status


def _status() -> dict[str, Any]:
    """Return the status; waits until somebody serves it."""
    asked = urllib.request.Request(
        f"http://127.0.0.1:{PORT}/status", headers={"Authorization": f"Bearer {own_token()}"}
    )
    while True:
        try:
            with urllib.request.urlopen(asked, timeout=20) as answer:
                status: dict[str, Any] = json.load(answer)
                return status
        except urllib.error.URLError:
            time.sleep(ASK_S)
