"""What the guest does while a fault comes: streams and records, or calibrates; and what is left. Runs in the guest."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from gellight.base.errors import GellightError
from gellight.bundle.bundle import load_bundle
from gellight.frames.camera import Camera, ReconnectingError
from gellight.frames.frames import CaptureStamp
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.preparing import full_colours
from gellight.lab.calibration.routine import Routine
from gellight.lab.calibration.state import state_in
from gellight.lab.training.training import TrainingOptions
from gellight.recording.recording_file import Recording, RecordingWriter
from gellight.sensor.sensor_camera import open_sensor
from tests.vm.inside.agent import report
from tests.vm.inside.looking import FIXED

POLL_S = 0.05
COLOURS = full_colours("RRRRGGGGBBBB")


def stream(number: str, bundle: str, place: str, count: int) -> dict[str, Any]:
    """Light a sensor and record frames of it; tell what was said where that ended early, and what can be read."""
    path, said, sequences = Path(place), "", list[int]()
    path.parent.mkdir(parents=True, exist_ok=True)
    loaded = load_bundle(bundle)
    try:
        with _opened(number) as camera, RecordingWriter(path, number) as writer:
            camera.adopt({}, COLOURS)
            for _ in range(count):
                frame = camera.read()
                sequences.append(frame.sequence)
                writer.add(frame, CaptureStamp(zeroed=loaded, unix_s=time.time()))
                report("frame", count=len(sequences))
    except GellightError as error:
        said = f"{type(error).__name__}: {error}"
    return {"said": said, "sequences": sequences, "kept": _kept(path), "draft": _drafts(path.parent)}


def _opened(number: str) -> Camera:
    return open_sensor(f"sensor://{number}?" + "&".join(f"{name}={value}" for name, value in FIXED.items()))


def _kept(path: Path) -> int:
    """Return how many frames a recording has, which are read; 0 where there is none."""
    if not path.exists():
        return 0
    try:
        return len([record.image(path.name) for record in Recording(path).frames()])
    except GellightError as error:
        if "no frames" in str(error) or "no recording" in str(error):
            return 0
        raise


def _drafts(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name.startswith("."))


def go_on(number: str, seconds: float) -> dict[str, Any]:
    """Stream lit for so long, through whatever comes; tell numbers, stamps, gaps and what was said."""
    sequences, stamps, gap_s, said = list[int](), list[float](), 0.0, ""
    with _opened(number) as camera:
        camera.adopt({}, COLOURS)
        camera.read()
        report("streaming")
        end_s = before_s = time.monotonic()
        end_s += seconds
        while time.monotonic() < end_s:
            try:
                frame = camera.read()
            except ReconnectingError as error:
                said = str(error)
                continue
            gap_s, before_s = max(gap_s, time.monotonic() - before_s), time.monotonic()
            sequences.append(frame.sequence)
            stamps.append(time.monotonic() - frame.time_s)
        mean = float(np.mean(camera.read().image))
    return {"sequences": sequences, "ages_s": stamps, "gap_s": gap_s, "said": said, "grey": mean}


def calibrate(number: str, place: str, seconds: float) -> dict[str, Any]:
    """Calibrate until a press is asked for, or for so long, and stop; tell how it ended, and what is kept."""
    folder = Path(place)
    options = RoutineOptions(
        out=folder / "bundle", sensor="lit", reference_frames=8, cylinder_presses=2, overwrite=True,
        training=TrainingOptions(trainer="numpy"),
    )  # fmt: skip
    try:
        with _opened(number) as camera:
            routine = Routine(camera, options, folder / "state")
            routine.act("start")
            end = _followed(routine, time.monotonic() + seconds)
            said = end["problem"]
            step = end["step"]
    except GellightError as error:
        said, step = f"{type(error).__name__}: {error}", "opening"
    state = state_in(folder / "state")
    done = [name for name, figures in state.steps.model_dump().items() if figures] if state else []
    return {"said": said, "step": step, "done": done}


def _followed(routine: Routine, end_s: float) -> dict[str, Any]:
    """Say next where that is asked for, and stop when the gel is to be pressed."""
    confirmed: set[str] = set()
    while not routine.ended:
        now = routine.snapshot()
        if "next" in now["actions"] and now["step"] in {"prepare", "reference"} - confirmed:
            confirmed.add(now["step"])
            routine.act("next")
            report("step", step=now["step"])
        if now["awaiting"] == "press" or time.monotonic() > end_s:
            routine.stop()
        time.sleep(POLL_S)
    routine.join()
    return routine.snapshot()


def freeze(seconds: int) -> str:
    """Let the kernel freeze every program for some seconds, as when it goes to sleep; say what it said.

    It wakes by itself: this is its own test of going to sleep, without the devices.
    """
    Path("/sys/module/suspend/parameters/pm_test_delay").write_text(str(seconds))
    Path("/sys/power/pm_test").write_text("freezer")
    try:
        Path("/sys/power/state").write_text("freeze")
    except OSError as error:
        return str(error)
    finally:
        Path("/sys/power/pm_test").write_text("none")
    return ""
