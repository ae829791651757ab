"""`gellight run` with several sensors, as a user runs it: a process each, one page, and one that fails."""

import json
import os
import re
import signal
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import STDOUT, Popen
from types import SimpleNamespace
from typing import Any

import pytest

from gellight.base.settings import SensorSettings, Settings
from gellight.cli.one_sensor import RunOptions
from gellight.cli.several_sensors import SensorProcess
from tests.helpers.children import GELLIGHT, gellight, started
from tests.helpers.command_line import invoke, refused
from tests.helpers.waiting import eventually

PATIENCE_S = 90.0
TWO = ("--sensor", "sim://?board=0&seed=1", "--sensor", "sim://?board=0&seed=2")


@contextmanager
def running(folder: Path, *arguments: str) -> Iterator[tuple[Popen[Any], Path]]:
    shown = folder / "shown"
    environment = os.environ | {"XDG_RUNTIME_DIR": str(folder), "PYTHONUNBUFFERED": "1"}
    with (
        shown.open("wb") as output,
        started([*GELLIGHT, "run", "--port", "0", *arguments], stdout=output, stderr=STDOUT, env=environment) as verb,
    ):
        yield verb, shown


def wait_for(shown: Path, pattern: str, count: int = 1) -> list[str]:
    end_s = time.monotonic() + PATIENCE_S
    while len(found := re.findall(pattern, shown.read_text())) < count:
        assert time.monotonic() < end_s, shown.read_text()
        time.sleep(0.1)
    return found


def fetch(address: str, path: str) -> Any:
    """What the page answers under `path`, once a sensor that it says is being started has said where its page is."""
    base, _, token = address.partition("?token=")
    asked = urllib.request.Request(base + path, headers={"Authorization": f"Bearer {token}"})
    end_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            with urllib.request.urlopen(asked, timeout=20) as answer:
                return json.loads(answer.read())
        except urllib.error.HTTPError as error:
            said = error.read().decode()
            if error.code != 503 or "it is being started" not in said or time.monotonic() > end_s:
                raise AssertionError(f"{error}: {said}") from error
        time.sleep(0.1)


def children(process: int) -> list[int]:
    """The processes of the sensors, in the order of their start."""
    text = Path(f"/proc/{process}/task/{process}/children").read_text()
    workers = [int(child) for child in text.split()]
    return [one for one in workers if "spawn_main" in Path(f"/proc/{one}/cmdline").read_text()]


def ignores_ctrl_c(process: int) -> bool:
    (ignored,) = re.findall(r"SigIgn:\s*(\w+)", Path(f"/proc/{process}/status").read_text())
    return bool(int(ignored, 16) >> signal.SIGINT - 1 & 1)


def test_a_process_is_asked_to_end_once() -> None:
    """A second signal would interrupt what makes the LEDs dark."""
    asked, settings = [], Settings(sensor=SensorSettings(url="sim://"))
    sensor = SensorProcess(1, settings, RunOptions())
    sensor._process = SimpleNamespace(  # type: ignore[assignment]
        terminate=lambda: asked.append("to end"), join=lambda timeout_s: None, is_alive=lambda: False
    )
    sensor.ask_to_end()
    sensor.stop()
    assert asked == ["to end"]


def test_two_sensors_run_in_processes_of_their_own_that_are_started_anew_and_ctrl_c_ends_all(tmp_path: Path) -> None:
    with running(tmp_path, *TWO) as (verb, shown):
        address = wait_for(shown, r"dashboard: (\S+)")[0]
        wait_for(shown, r"publishing: gellight.subscribe\('(.*)'\)", 2)
        names = {sensor["sensor"]: sensor["error"] for sensor in fetch(address, "sensors")}
        assert names == {"1: sim://?board=0&seed=1": None, "2: sim://?board=0&seed=2": None}
        assert {fetch(address, f"{key}/status")["sensor"] for key in "12"} == {TWO[1], TWO[3]}
        first, second = children(verb.pid)

        before = fetch(address, "2/status")["frames"]
        os.kill(first, signal.SIGKILL)
        wait_for(shown, re.escape("1: sim://?board=0&seed=1: its process broke off (exit status -9), starting it anew"))
        assert fetch(address, "sensors")[1]["error"] is None
        wait_for(shown, "publishing: ", 3)
        assert fetch(address, "1/status")["error"] is None
        assert fetch(address, "2/status")["frames"] > before
        processes = children(verb.pid)
        assert len(processes) == 2
        assert second in processes
        assert first not in processes

        assert all(ignores_ctrl_c(process) for process in processes), "their parent asks them to end, once"
        os.killpg(verb.pid, signal.SIGINT)  # as a terminal does
        assert verb.wait(PATIENCE_S) == 0, shown.read_text()
        assert not any(Path(f"/proc/{process}").exists() for process in processes)
        assert "Traceback" not in shown.read_text()


def test_the_processes_end_with_their_parent_however_it_ends(tmp_path: Path) -> None:
    with running(tmp_path, *TWO, "--no-dashboard") as (verb, shown):
        wait_for(shown, "publishing: ", 2)
        processes = children(verb.pid)
        verb.kill()
        eventually(lambda: not any(Path(f"/proc/{process}").exists() for process in processes), 20)


def test_a_sensor_that_cannot_be_opened_leaves_the_other_alone() -> None:
    run = gellight("run", "--sensor", "sim://?board=0", "--sensor", "sim://?nonsense=1", "--frames", "3", "--json")
    assert run.returncode == 2
    summary = json.loads(run.stdout.splitlines()[-1])
    assert summary["1: sim://?board=0"]["frames"] == 3
    assert {"sensor", "fps", "lost", "error", "camera"} <= set(summary["1: sim://?board=0"])
    assert "gellight: 1 of 2 sensors failed: 2: sim://?nonsense=1: " in run.stderr
    assert "unknown parameter nonsense" in run.stderr
    assert "Traceback" not in run.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--name", "left"), "--name names one sensor, several are given"),
        (("--calibration", "my-bundle"), "--calibration my-bundle is of one sensor, several are given"),
        (("--ros2", "tcp/localhost:7447", "--set", "stream.enabled=false"), "have no names of their own"),
        (("--sensor", "sensor://X", "--sensor", "sensor://X"), "sensor"),
    ],
)
def test_what_is_of_one_sensor_is_refused_before_anything_starts(arguments: tuple[str, ...], said: str) -> None:
    run = invoke("run", *TWO, *arguments, "--frames", "1")
    assert said in refused(run)
    assert "publishing" not in run.stderr
