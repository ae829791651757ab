"""What the guest does with whole sensors: discovery, reconnection, the command line and its dashboard. Runs there."""

import contextlib
import io
import json
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Any

from gellight.base.errors import GellightError
from gellight.base.runtime_folder import own_token
from gellight.cli import main
from gellight.frames.camera import ReconnectingError
from gellight.sensor.discovery import discover
from gellight.sensor.sensor_camera import open_sensor
from tests.vm.inside.agent import report
from tests.vm.inside.looking import FIXED


def sensors() -> dict[str, Any]:
    """Return what discovery finds."""
    found = discover()
    return {
        "sensors": [
            {"serial": s.serial, "port": s.port, "camera": s.camera.stable, "ring": s.ring.path if s.ring else ""}
            for s in found.sensors
        ],
        "single cameras": len(found.cameras),
        "ambiguities": list(found.ambiguities),
        "only": _refusal(lambda: found.only()),
    }


def _refusal(ask: Any) -> str:
    try:
        ask()
    except GellightError as error:
        return str(error)
    return ""


def refusal(url: str) -> str:
    """Return the message with which a sensor cannot be opened."""
    return _refusal(lambda: open_sensor(url).close())


def recover(number: str) -> dict[str, Any]:
    """Read from a sensor through an unplugging; return how it went and how long what took."""
    options = "&".join(f"{name}={value}" for name, value in FIXED.items())
    with open_sensor(f"sensor://{number}?{options}") as camera:
        before = [camera.read().sequence for _ in range(3)]
        report("streaming")
        said, lost_s = "", 0.0
        while True:
            asked_s = time.monotonic()
            try:
                frame = camera.read()
            except ReconnectingError as error:
                said, lost_s = str(error), lost_s or time.monotonic()
                continue
            if said:
                break
        return {
            "said": said,
            "lost_s": lost_s,
            "back_s": time.monotonic(),
            "asked_s": asked_s,
            "sequences": [*before, frame.sequence],
            "status": camera.status(),
        }


def gellight(arguments: list[str]) -> dict[str, Any]:
    """Run the command line in this process, which is the call's own."""
    begun_s, status = time.monotonic(), 0
    said, complained = io.StringIO(), io.StringIO()
    sys.argv = ["gellight", *arguments]
    # To import PyTorch takes minutes on the emulated processor; the doctor tries what trains.
    sys.modules["torch"] = None  # type: ignore[assignment]
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
        try:
            main.run()
        except SystemExit as end:
            status = int(end.code or 0)
    seconds = time.monotonic() - begun_s
    return {"status": status, "out": said.getvalue(), "err": complained.getvalue(), "seconds": seconds}


PORT = 8420
ASK_S = 0.1


def run_through(arguments: list[str]) -> dict[str, Any]:
    """Run `gellight run` and report its status when it streams, when the sensor is away, and when it is back."""
    client = threading.Thread(target=_follow, daemon=True)
    client.start()
    found = gellight(["run", *arguments, "--set", f"dashboard.port={PORT}"])
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
