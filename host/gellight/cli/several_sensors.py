"""Several sensors in one daemon: a process each, one page for all, and one that fails leaves the others alone."""

import json
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection

from gellight.base import logs
from gellight.base.errors import CameraError, ConfigError, GellightError
from gellight.base.parent import end_with_parent
from gellight.base.service_manager import ServiceManager
from gellight.base.settings import Settings
from gellight.cli.ending import Ending, end
from gellight.cli.one_sensor import STATUS_S, follow, opened, print_status
from gellight.cli.run_options import RunOptions
from gellight.cli.showing import show, table
from gellight.dashboard.chooser import Choice, Chooser
from gellight.dashboard.server import PageServer
from gellight.frames.status import SensorStatus
from gellight.opening import REAL

RESTART_S = 2.0
"""from the fault of a sensor's process to its next start"""
STOP_S = 1.5
"""as long a process may take to make its LEDs dark and end"""
SPAWN = multiprocessing.get_context("spawn")


@dataclass(frozen=True, kw_only=True)
class Report:
    """What the process of a sensor says."""

    address: str = ""
    """of its dashboard"""
    status: Mapping[str, object] = field(default_factory=dict)
    """see `SensorSession.status`"""
    error: str | None = None
    """why it cannot go on"""


def run_several(each: list[Settings], options: RunOptions, *, dashboard: bool, as_json: bool) -> None:
    """Run a process for each of these settings until all have ended or Ctrl-C.

    Raises InputError or ConfigError for settings that cannot be used together, before anything is started, and
    CameraError at the end where one of the sensors could not be run.
    """
    _check(each)
    logs.configure(each[0].service.log, "")
    sensors = [SensorProcess(number, one, options) for number, one in enumerate(each, 1)]
    with options.ended_by_hand(), ExitStack() as stack:
        if dashboard:
            choices = Chooser(lambda: {sensor.key: sensor.choice() for sensor in sensors})
            server = stack.enter_context(PageServer(choices.application, **each[0].dashboard.model_dump()))
            logs.say(f"dashboard: {server.url}   (Ctrl-C stops)")
        for sensor in sensors:
            sensor.start()
            stack.callback(sensor.stop)
        for sensor in sensors:  # all are asked to end before the first is waited for
            stack.callback(sensor.ask_to_end)
        _watch(sensors, as_json and not options.frames)
        summary = {sensor.name: dict(sensor.report.status) for sensor in sensors}
        show(summary, as_json, "\n\n".join(map(table, summary.values())))
    if failed := [f"{sensor.name}: {sensor.report.error}" for sensor in sensors if sensor.report.error]:
        raise CameraError(f"{len(failed)} of {len(sensors)} sensors failed: {'; '.join(failed)}")


def _check(each: list[Settings]) -> None:
    """Refuse settings that hold for one sensor alone, and sensors that do not go together."""
    if each[0].stream.name:
        raise ConfigError("--name names one sensor, several are given: they publish under their own names")
    nameless = [one.sensor.url for one in each if not one.sensor.url.startswith(REAL)]
    if each[0].stream.ros2 and not each[0].stream.enabled and len(nameless) > 1:
        raise ConfigError(
            f"{', '.join(nameless)} have no names of their own, by which their ROS 2 topics could differ: leave out "
            "stream.enabled = false, then they are numbered"
        )
    bundle = each[0].sensor.calibration
    if bundle not in (None, "auto", "synthetic"):
        raise ConfigError(f"--calibration {bundle} is of one sensor, several are given: each uses the one in service")
    if real := [one.sensor.url for one in each if one.sensor.url.startswith(REAL)]:
        from gellight.sensor.bandwidth import check_bandwidth  # Linux alone has what it asks

        check_bandwidth(real)


def _watch(sensors: list["SensorProcess"], as_json: bool) -> None:
    """Follow the processes until all have ended; start one anew that broke off."""
    manager, told_ready = ServiceManager(), False
    while any(sensor.goes_on() for sensor in sensors):
        if not told_ready and all(sensor.report.address or sensor.report.status for sensor in sensors if sensor.alive):
            manager.ready()
            told_ready = True
        manager.alive(*(sensor.life() for sensor in sensors))
        if as_json:
            print(json.dumps({sensor.name: dict(sensor.report.status) for sensor in sensors}), flush=True)
        time.sleep(STATUS_S / 4)


class SensorProcess:
    """The process of one sensor, as its parent sees it."""

    def __init__(self, number: int, settings: Settings, options: RunOptions) -> None:
        """Run `settings`; the dashboard of the process is at a free port of this machine."""
        inner = {"port": 0, "host": "127.0.0.1", "token": "", "tls_cert": "", "tls_key": ""}
        own = settings.dashboard.model_copy(update=inner)
        self.key, self.name = str(number), f"{number}: {settings.sensor.url}"
        view = settings.stream.model_copy(update={"foxglove_port": settings.stream.foxglove_port + number - 1})
        self._settings, self._options = settings.model_copy(update={"dashboard": own, "stream": view}), options
        self.report = Report()
        self._broke_off_s: float | None = None
        self._asked = False
        """to end"""

    def start(self) -> None:
        """Start the process."""
        ours, theirs = SPAWN.Pipe(duplex=False)
        self._process = SPAWN.Process(target=work, args=(self._settings, self._options, theirs), name=self.name)
        self._process.start()
        theirs.close()
        threading.Thread(target=self._listen, args=(ours,), name=f"reports of {self.name}", daemon=True).start()

    def _listen(self, reports: Connection) -> None:
        with reports:
            while True:
                try:
                    self.report = reports.recv()
                except (EOFError, OSError):
                    return

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_alive()

    def goes_on(self) -> bool:
        """Whether it runs or will run again; it is started anew a while after it broke off by a fault or a signal."""
        status = self._process.exitcode
        if status is None:
            return True
        if status in (Ending.DONE, Ending.REFUSED):
            return False
        if self._broke_off_s is None:
            self._broke_off_s = time.monotonic()
            self.report = Report(status=self.report.status, error=f"its process broke off (exit status {status})")
            logs.say(f"gellight: {self.name}: {self.report.error}, starting it anew", level=logging.ERROR)
        elif time.monotonic() - self._broke_off_s > RESTART_S:
            self._broke_off_s, self.report = None, Report()
            self.start()
        return True

    def choice(self) -> Choice:
        """Return what the page shows of it."""
        error = self.report.error or self.report.status.get("error")
        address = self.report.address if self.alive else ""
        return Choice(key=self.key, sensor=self.name, error=None if error is None else str(error), address=address)

    def life(self) -> tuple[int, bool]:
        """Return what the service manager is told of it: its frames, and whether it is known why none come."""
        away = not self.alive or self.choice().error is not None
        return int(str(self.report.status.get("frames", 0))), away

    def ask_to_end(self) -> None:
        """Ask it, once, to make its LEDs dark and end: a second signal would interrupt that."""
        if not self._asked:
            self._asked = True
            self._process.terminate()

    def stop(self) -> None:
        """Wait for its end; kill it where it does not come."""
        self.ask_to_end()
        self._process.join(STOP_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


# ---- in the process of a sensor ----


def work(settings: Settings, options: RunOptions, reports: Connection) -> None:
    """Run one sensor, and say how it is; exit as `gellight run` does."""
    os.environ.pop("NOTIFY_SOCKET", None)  # the parent speaks to the service manager
    logs.configure(settings.service.log, settings.sensor.url)
    end_with_parent()  # nobody else could make the LEDs dark
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's Ctrl-C goes to all: the parent asks this one to end
    end(partial(_stream, settings, options, reports))


def _stream(settings: Settings, options: RunOptions, reports: Connection) -> None:
    address = ""

    def tell(status: SensorStatus) -> None:
        reports.send(Report(address=address, status=status))
        print_status(status, as_json=False)

    try:
        with options.ended_by_hand(), opened(settings) as (daemon, address):
            tell(daemon.status())
            tell(follow(daemon, options.frames, tell))
    except GellightError as error:
        reports.send(Report(error=str(error)))
        raise
