"""The calibration routine on a sensor that is plugged in. Runs in the guest; who presses is told what and when."""

import time
from pathlib import Path
from typing import Any

from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.routine import Routine
from gellight.sensor.sensor_camera import open_sensor
from tests.vm.inside.agent import report

POLL_S = 0.05


def calibrate(url: str, folder: str, presses: int) -> dict[str, Any]:
    """Calibrate as a user at the terminal would until that many presses are taken, and stop; report what is due."""
    place, circles, confirmed = Path(folder), dict[int, dict[str, float]](), {"prepare", "reference"}
    options = RoutineOptions(out=place / "bundle", sensor="fine", cylinder_presses=2, reference_frames=8)
    with open_sensor(url) as camera:
        routine = Routine(camera, options, place / "state")
        routine.act("start")
        told: tuple[Any, ...] = ()
        while not routine.ended:
            now = routine.snapshot()
            if "next" in now["actions"] and now["step"] in confirmed:
                confirmed.remove(now["step"])
                routine.act("next")
            if now["step"] == "presses" and "press" in now:
                circles[now["press"]["number"]] = now["press"]
            due = now["step"], now["awaiting"], now["problem"], now["progress"].get("done")
            if due != told:
                report("due", step=due[0], action=due[1], problem=due[2])
                told = due
            if len(circles) == presses:
                routine.stop()
            time.sleep(POLL_S)
        routine.join()
        end = routine.snapshot()
        kept = {name: end[name] for name in ("step", "problem", "figures")}
        return {**kept, "circles": list(circles.values()), "mode": camera.status()["mode"]}
