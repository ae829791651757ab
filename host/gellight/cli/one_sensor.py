"""How a verb runs one sensor: the dashboard, the publisher, and the end."""

import json
import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from functools import partial
from importlib.metadata import entry_points
from math import inf
from pathlib import Path
from typing import Any

from gellight.base import logs
from gellight.base.beside import installed
from gellight.base.errors import CameraError
from gellight.base.process import ServiceManager, give_back_large_arrays
from gellight.base.settings import Settings
from gellight.bundle.bundle import SYNTHETIC, Bundle, load_bundle
from gellight.cli.options import RunOptions
from gellight.cli.showing import show
from gellight.daemon.assembly import open_session
from gellight.daemon.session import SensorSession
from gellight.frames.camera import EndOfStream
from gellight.frames.frames import TactileFrame
from gellight.frames.status import SensorStatus
from gellight.opening import REAL
from gellight.stream.frame_thread import sent_to
from gellight.stream.network import zenoh_settings
from gellight.stream.publisher import Publisher, name_of_sensor
from gellight.stream.running import running

STATUS_S = 1.0  # chosen: how often a line in the terminal is renewed
WAIT_S = 0.5  # chosen: how late an end is noticed while no frame comes


def run_sensor(settings: Settings, options: RunOptions, *, dashboard: bool, as_json: bool) -> None:
    """Run the sensor of `settings` until the frames are there, the images are used up, or Ctrl-C."""
    logs.configure(settings.service.log, settings.sensor.url)
    with options.ended_by_hand(), opened(settings, dashboard=dashboard) as (daemon, _):
        manager = ServiceManager()
        manager.ready()
        summary = follow(daemon, options.frames, partial(tell, manager, as_json and not options.frames))
        show(summary, as_json, in_words(summary, options.frames))


@contextmanager
def opened(settings: Settings, *, every: bool = True, dashboard: bool = True) -> Iterator[tuple[SensorSession, str]]:
    """Open the sensor of `settings`, serve and publish it; yield it and the address of its dashboard."""
    give_back_large_arrays()
    check_buses(settings.sensor.url)
    if settings.stream.enabled and settings.stream.zenoh_config:
        zenoh_settings(Path(settings.stream.zenoh_config))  # a wrong file is told before a sensor is opened
    bridges(settings)  # and so is a bridge that is not installed
    with ExitStack() as stack:
        daemon = stack.enter_context(open_session(settings, every=every))
        address = stack.enter_context(served(daemon, settings, dashboard))
        stack.enter_context(published(daemon, settings, address))
        yield daemon, address


def check_buses(url: str) -> None:
    """Refuse a real camera that runs already, or does not fit on its USB bus beside those that run."""
    others = [daemon.sensor for daemon in running() if daemon.sensor.startswith(REAL)]
    if others and url.startswith(REAL):
        from gellight.sensor.bandwidth import check_bandwidth  # Linux alone has what it asks

        check_bandwidth([url, *others])


def tell(manager: ServiceManager, as_json: bool, status: SensorStatus) -> None:
    """Print the status, and tell the service manager, where there is one, that the sensor works."""
    manager.alive(status["frames"], away=status["error"] is not None)
    print_status(status, as_json)


def warn_of_foreign_bundle(bundle: Bundle, settings: Settings) -> None:
    """Say so where a sensor has no bundle, or is another one than the default, simulated, and used with its bundle."""
    told, changed = "", ", ".join(settings.geometry.overrides())
    if not bundle.calibrated:
        told = (
            "this sensor has no bundle, so there is no depth: calibrate it on the page, or with `gellight calibrate`"
            if "://" in settings.sensor.url
            else "these pictures have no bundle, so there is no depth: give that of their sensor by --calibration"
        )
    elif bundle.identity == load_bundle(SYNTHETIC).identity and settings.sensor.url.startswith(REAL):
        told = (
            "the bundle `synthetic` is of the simulated sensor: calibrate yours with `gellight calibrate` before you "
            "trust its depth"
        )
    elif bundle.identity == load_bundle(SYNTHETIC).identity and settings.sensor.url.startswith("sim://") and changed:
        told = (
            f"the bundle `synthetic` is of the default sensor, the settings change its {changed}: make one with "
            "`gellight calibrate --auto --sensor sim://` before you trust the depth"
        )
    if told:
        logs.say(f"gellight: {told}", level=logging.WARNING)


@contextmanager
def published(daemon: SensorSession, settings: Settings, page: str) -> Iterator[None]:
    """Publish the frames to other programs, unless the settings say no, to ROS 2 and Foxglove where they say so.

    page: the address of the dashboard, which those of other sensors offer.
    """
    chosen = settings.stream
    config = Path(chosen.zenoh_config) if chosen.zenoh_config else None
    name = chosen.name or name_of_sensor(daemon.camera)
    with ExitStack() as stack:
        if chosen.enabled:
            publisher = stack.enter_context(
                Publisher(daemon, name=chosen.name, lan=chosen.lan, config=config, token=chosen.token, page=page)
            )
            there = f"zenoh://<this computer>:{publisher.lan_port}/{publisher.name}" if chosen.lan else publisher.name
            logs.say(f"publishing: gellight.subscribe({there!r})")
            if chosen.lan:
                logs.say(f"other computers can read; to change something they give token={publisher.token!r}")
            name = publisher.name  # numbered where several sensors have no name of their own
        for bridge in bridges(settings):
            stack.enter_context(bridge(daemon, name, settings))
        for sink in filter(None, chosen.sinks.split(",")):
            stack.enter_context(sent_to(sink, daemon, name))
        yield


def bridges(settings: Settings) -> list[Callable[..., AbstractContextManager[None]]]:
    """Return what carries frames to ROS 2 and to Foxglove, of those that `stream.ros2` and `stream.foxglove` ask for.

    Each is called with the sensor, its name and the settings: a sink gets frames alone, these report also where none
    come. InputError where one is not installed.
    """
    extras = {"ros2": "ros", "foxglove": "foxglove"}
    return [
        installed("gellight.bridges", name=name, what=f"stream.{name}", home="gellight_ros", extra=extra)
        for name, extra in extras.items()
        if getattr(settings.stream, name)
    ]


@contextmanager
def served(daemon: SensorSession, settings: Settings, wanted: bool = True) -> Iterator[str]:
    """Serve the dashboard, if wanted, and yield its address, which is empty without one."""
    warn_of_foreign_bundle(daemon.bundle, settings)
    if not wanted:
        yield ""
        return
    # The lab, SciPy and aiohttp take longer, and half as much memory, as all that a sensor without a page needs.
    from gellight.daemon.calibration_service import CalibrationService
    from gellight.dashboard.server import DashboardServer

    with (
        CalibrationService(daemon, geometry=settings.geometry.overrides()) as service,
        panel("scan", daemon, lambda: service.calibrating) as scan,
        DashboardServer(
            daemon, calibration=service, scan=scan, sensors=pages, **settings.dashboard.model_dump()
        ) as server,
    ):
        logs.say(f"dashboard: {server.url}   (Ctrl-C stops)")
        yield server.url


def pages() -> dict[str, str]:
    """Return the addresses of the pages of this user's sensors on this computer, by name."""
    return {daemon.name: daemon.page for daemon in running() if daemon.page}


def panel(name: str, daemon: SensorSession, busy: Callable[[], bool]) -> AbstractContextManager[Any]:
    """Return what an installed distribution has for the page by this name (entry point `gellight.panels`), or None.

    It is a context manager, made with the sensor and what says that the sensor is busy: a `ScanController`.
    """
    for found in entry_points(group="gellight.panels", name=name):
        made: AbstractContextManager[Any] = found.load()(daemon, busy=busy)
        return made
    return nullcontext()


class Summary(SensorStatus):
    """The last status of a run, with the rate over all of it."""

    indentation_mm: float
    """the deepest of all frames"""


def in_words(summary: Summary, wanted: int) -> str:
    """Return how a run went, and why it ended where that was before `wanted` frames."""
    frames, age, touch = summary["frames"], summary["frame_age_ms"], summary["touch"]
    of = f" of {wanted}: there were no more" if 0 < frames < wanted else ""
    lines = [
        f"{frames} frames{of}",
        f"{summary['fps']:.1f} a second, {summary['lost']} lost, {summary['dropped']} dropped",
    ]
    if age:
        lines[-1] += f"; depth was there after {age['median']:.0f} ms, 95 % of it after {age['p95']:.0f} ms"
    if touch:
        lines.append(f"the deepest touch was {summary['indentation_mm']:.3f} mm")
    if touch and (force := touch["force"]):
        lines[-1] += f"; the last frame feels {force['normal_n']:.2f} +- {force['error_n']:.2f} N"
    return "\n".join(line + "." for line in lines)


def frames_of(daemon: SensorSession) -> Iterator[TactileFrame | None]:
    """Yield the frames as they come, None where none came for `WAIT_S`; end where there are no more."""
    sequence = -1
    while True:
        try:
            frame = daemon.next_frame(sequence, WAIT_S)
        except EndOfStream:
            return
        except TimeoutError:
            yield None
        else:
            sequence = frame.camera_frame.sequence
            yield frame


def follow(
    daemon: SensorSession, frames: int, show: Callable[[SensorStatus], None] | None = None, patience_s: float = inf
) -> Summary:
    """Follow the tactile frames until `frames` came (0: for ever); return the status with the figures of the run.

    show: is given the status every second. Raises what ends the run, and CameraError after `patience_s` without a
    frame: a sensor that is unplugged is waited for. The images of a folder end it when they are used up.
    """
    count, deepest_mm, shown_s = 0, 0.0, 0.0
    begun_s = frame_s = time.monotonic()
    for frame in frames_of(daemon):
        if frame is not None:
            count, frame_s = count + 1, time.monotonic()
            deepest_mm = max(deepest_mm, frame.contact.indentation_mm)
        elif time.monotonic() - frame_s > patience_s:
            raise CameraError(f"no frame for {patience_s:g} s: check the camera and start again")
        if show and time.monotonic() - shown_s >= STATUS_S:
            shown_s = time.monotonic()
            show(daemon.status())
        if frames and count == frames:
            break
    fps = round(count / (time.monotonic() - begun_s), 2)
    return {**daemon.status(), "frames": count, "fps": fps, "indentation_mm": round(deepest_mm, 4)}


def print_status(status: SensorStatus, as_json: bool) -> None:
    """Print the status: JSON to standard output, or one line for people on a terminal."""
    if as_json:
        print(json.dumps(status), flush=True)
    elif status["error"]:
        logs.say(f"gellight: {status['error']}", level=logging.ERROR)
    elif sys.stderr.isatty():
        print(f"\r{status['frames']} frames, {status['fps']} frames/s, age {status['frame_age_ms']} ms, "
              f"{status['lost']} lost", end="", file=sys.stderr, flush=True)  # fmt: skip
