"""What the guest does with whole sensors: discovery, reconnection, the command line. Runs in the guest."""

import contextlib
import io
import sys
import time
from typing import Any

from gellight.base.errors import GellightError
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
