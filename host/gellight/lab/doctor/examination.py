"""What stands between a sensor and good frames: each finding with its remedy.

The checks here look at the computer; `sensor_checks.py` opens the sensor.
"""

import os
import shutil
import time
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

from gellight.base.errors import INSTALL_UDEV, BoardError, GellightError, InputError
from gellight.base.holders import holders
from gellight.lab.doctor.sensor_checks import check_sensor
from gellight.ring.transport import is_board
from gellight.sensor import udev
from gellight.sensor.connection import Surroundings
from gellight.sensor.discovery import NOTHING, SEE_SIMULATED, Discovery, Node, Sensor, attribute
from gellight.sensor.findings import Finding, Level, failure, judged, ok, problem, warning
from gellight.sensor.v4l2.options import parse_url

REMEDY = "use a hub with a power supply of its own, or a port of the computer for each"


def check_power(sysfs: Path, cameras: Collection[str]) -> Iterator[Finding]:
    """Name each board, and each camera at these USB ports, that Linux refused its current; nothing where there is none.

    Cameras that were refused have no node, and so are not known by port.
    """
    ours = [
        entry for entry in sorted((sysfs / "bus/usb/devices").glob("*-*"))
        if ":" not in entry.name and (entry.name in cameras or is_board(*_identity(entry)))
    ]  # fmt: skip
    refused = [entry for entry in ours if attribute(entry / "bConfigurationValue") == ""]
    for entry in refused:
        text = (
            f"{attribute(entry / 'product') or entry.name} at USB {entry.name} asks for more current than its hub gives"
        )
        yield problem("power", f"{text}, so Linux does not switch it on", REMEDY)
    if ours and not refused:
        yield ok("power", "every port gives what is asked for")


def _identity(device: Path) -> tuple[int, int, str]:
    vendor, product = (int(attribute(device / name) or "0", 16) for name in ("idVendor", "idProduct"))
    return vendor, product, attribute(device / "product")


HIGH_SPEED_MBPS = 480.0  # USB 2.0: high speed
LEAST_DISK_BYTES = 1_000_000_000  # chosen: two bundles with their presses
EARLIEST_YEAR = 2025  # chosen: GelLight is younger, so an earlier date is wrong
SLOW_CLOCKS = ("hpet", "acpi_pm", "jiffies")


def examine(
    name: str | None = None, *, surroundings: Surroundings, folder: Path, rules: Path = udev.FOLDER
) -> Iterator[Finding]:
    """Check the computer, then every sensor, or the one that `name` is: its URL, serial number, USB port or camera.

    `folder` is where recordings go. Raises InputError for a URL of no real sensor.
    """
    name, ring = _named(name)
    yield check_rule(rules)
    yield check_disk(folder)
    yield from check_clock(surroundings.sysfs)
    found = surroundings.look()
    yield from check_found(found, name)
    yield from check_power(surroundings.sysfs, {node.usb.port for node in _cameras(found, name) if node.usb})
    for sensor in _chosen(found, name):
        if ring is not None:
            try:
                sensor = _lit_by(found, sensor, ring)
            except BoardError as error:
                yield failure("sensors", error)
                continue
        yield from check_speed(found, sensor)
        reachable = [check_permission(node) for node in reversed(sensor.nodes)]
        yield from reachable
        if all(finding.level is not Level.PROBLEM for finding in reachable):
            yield from check_sensor(sensor, surroundings)


def _named(text: str | None) -> tuple[str | None, str | None]:
    """Return the name in what a user gives, None for every sensor, and the URL of the ring that it names."""
    if text is None or ("://" not in text and text != "auto"):
        return text, None
    if not text.startswith(("auto", "sensor://", "v4l2://")):
        raise InputError(f"{text} is no real sensor: give one of `gellight find`, or nothing for every sensor")
    place, options = parse_url(text)
    return None if place == "auto" else place, options.ring


def _chosen(found: Discovery, name: str | None) -> list[Sensor]:
    """Return the sensors to examine: all, or those with a name, a USB port, or a camera at a path."""
    return list(found.sensors) if name is None else [each for each in found.with_cameras() if each.is_called(name)]


def _cameras(found: Discovery, name: str | None) -> list[Node]:
    """Return the cameras of the chosen sensors, and of a computer's own only one that was asked for by name."""
    return [sensor.camera for sensor in (_chosen(found, name) if name else found.sensors)]


def _lit_by(found: Discovery, sensor: Sensor, url: str) -> Sensor:
    """Return the sensor with the ring at a URL; BoardError where there is none."""
    for ring in (*found.rings, *(other.ring for other in found.sensors if other.ring)):
        if ring.is_at(url):
            return replace(sensor, ring=ring)
    raise BoardError(f"no light ring is at {url}: plug it in; `gellight find` lists what is there")


def check_rule(folder: Path) -> Finding:
    """Look whether the udev rule is installed."""
    if udev.installed(folder=folder):
        return ok("udev rule", f"{folder / udev.RULE.name} is installed")
    return warning("udev rule", f"{folder / udev.RULE.name} is missing or old", f"run {INSTALL_UDEV}")


def check_disk(folder: Path) -> Finding:
    """Look whether recordings and bundles find room."""
    free = shutil.disk_usage(folder).free
    remedy = "make room: a bundle with its presses takes up to 500 MB"
    return judged("disk", f"{free / 1e9:.1f} GB free in {folder}", bad=free < LEAST_DISK_BYTES, remedy=remedy)


def check_clock(sysfs: Path) -> Iterator[Finding]:
    """Look whether the date is plausible and the clock of the time stamps is quick to read."""
    year = time.gmtime().tm_year
    if year < EARLIEST_YEAR:
        yield problem("clock", f"the computer believes it is {year}", "set the date, for example with NTP")
    else:
        yield ok("clock", f"the date is plausible ({time.strftime('%Y-%m-%d')})")
    source = attribute(sysfs / "devices/system/clocksource/clocksource0/current_clocksource")
    if source in SLOW_CLOCKS:
        yield warning("clock", f"the kernel counts time by {source}, which is slow", "boot with tsc as clock source")
    elif source:
        yield ok("clock", f"the kernel counts time by {source}")


def check_found(found: Discovery, name: str | None) -> Iterator[Finding]:
    """List the sensors, and those that cannot be distinguished."""
    for text in found.ambiguities:
        what, _, remedy = text.rpartition(": ")
        yield problem("sensors", what, remedy)
    chosen = _chosen(found, name)
    if found.empty:
        yield problem("sensors", NOTHING, SEE_SIMULATED)
    elif not chosen:
        try:
            _ = found.called(name) if name else found.only()
        except GellightError as error:
            yield failure("sensors", error)
    for sensor in dict.fromkeys((*found.sensors, *chosen)):
        ring = sensor.ring.stable if sensor.ring else "none"
        yield ok("sensors", f"{sensor.name} at USB {sensor.port}: camera {sensor.camera.stable}, ring {ring}")


def check_permission(node: Node) -> Finding:
    """Check that this user may use a node and that no other program has it open."""
    if not os.access(node.path, os.R_OK | os.W_OK):
        return problem(
            "permission", f"you may not use {node.path}",
            f"run {INSTALL_UDEV}, then unplug the sensor and plug it in; over ssh also `sudo usermod -aG video $USER`, "
            "then log in again",
        )  # fmt: skip
    if others := holders(node.path):
        names = ", ".join(f"{command} (process {number})" for number, command in others)
        return warning("permission", f"{node.path} is also open in {names}", "end that programme if frames do not come")
    return ok("permission", f"{node.path} may be used and is free")


def check_speed(found: Discovery, sensor: Sensor) -> Iterator[Finding]:
    """Check the speed of the connection, and look for other cameras on the bus."""
    usb = sensor.camera.usb
    if usb is None:
        return
    text = f"{sensor.name} is connected at {usb.speed_mbps:g} Mbit/s"
    if usb.speed_mbps < HIGH_SPEED_MBPS:
        yield problem("usb", text, "use another cable, another port or no hub: a camera needs 480 Mbit/s")
    else:
        yield ok("usb", text)
    bus = usb.port.partition("-")[0]
    nodes = [other.camera for other in found.with_cameras() if other.camera != sensor.camera]
    others = [node for node in nodes if node.usb and node.usb.port.partition("-")[0] == bus]
    if others and usb.speed_mbps <= HIGH_SPEED_MBPS:
        yield warning(
            "usb", f"{len(others)} more cameras share USB bus {bus} with {sensor.name}",
            "use format=MJPG, or ports of different controllers, if frames are lost",
        )  # fmt: skip
