"""Which sensors are plugged in: cameras and light rings that share a USB parent, read from sysfs.

A sensor is either one USB device with a camera and a serial port, or a camera and a ring board behind one hub of their
own. What hangs at the root hub of the computer shares it with everything else there, a built-in webcam for example, so
that alone makes no pair. Nothing is opened here, so nothing can be busy and no permission is needed.
"""

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from gellight.base.errors import CameraError
from gellight.ring.transport import is_board
from gellight.sensor.v4l2.errors import UnpluggedError

SYSFS, DEV = Path("/sys"), Path("/dev")
NOTHING = "no camera and no light ring are plugged in"
SEE_SIMULATED = "check the cable; `gellight demo` shows a simulated sensor"
_LIST = "`gellight find` lists what is there"


@dataclass(frozen=True, kw_only=True)
class UsbDevice:
    """One device on the bus, as sysfs describes it."""

    port: str
    """bus and ports on the way to it, such as 1-1.4: the same socket has the same name after unplugging"""
    vendor: int
    product: int
    serial: str
    """empty where it has none"""
    name: str
    """manufacturer and product string"""
    product_name: str
    speed_mbps: float
    parent: str
    """port of the hub it hangs at; usb1 and the like is the root hub of a bus"""


@dataclass(frozen=True, kw_only=True)
class Node:
    """A device node of a camera or of a ring."""

    path: str
    """such as /dev/video0"""
    stable: str
    """the link below by-id or by-path that stays the same, or else `path`"""
    name: str
    usb: UsbDevice | None
    """None where it is not on USB"""

    def is_at(self, url: str) -> bool:
        """Whether the URL of a ring names it: by its serial number, or by its node or a link to that."""
        serial = self.usb.serial if self.usb else ""
        return (bool(serial) and url == f"serial://{serial}") or Path(url).resolve() == Path(self.path).resolve()


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A camera, and the ring that lights what it sees."""

    camera: Node
    ring: Node | None

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The ring, where there is one, and the camera."""
        return (self.ring, self.camera) if self.ring else (self.camera,)

    @property
    def serials(self) -> list[str]:
        """Serial numbers of both, the ring's first."""
        return [node.usb.serial for node in self.nodes if node.usb and node.usb.serial]

    @property
    def serial(self) -> str:
        """Serial number: the ring's where it is a device of its own, since cameras often share theirs; may be empty."""
        return next(iter(self.serials), "")

    @property
    def port(self) -> str:
        """USB port of the camera; the node where it is not on USB."""
        return self.camera.usb.port if self.camera.usb else self.camera.path

    def is_called(self, name: str) -> bool:
        """Whether that is its serial number, its USB port or the node of its camera."""
        return name in (self.name, self.port, self.camera.path, self.camera.stable, *self.serials)

    @property
    def name(self) -> str:
        """How to call it: the serial number, or the USB port."""
        return self.serial or self.port


@dataclass(frozen=True, kw_only=True)
class Discovery:
    """Everything that was found."""

    sensors: tuple[Sensor, ...]
    cameras: tuple[Node, ...]
    """without a ring"""
    rings: tuple[Node, ...]
    """without a camera"""
    ambiguities: tuple[str, ...]

    def called(self, name: str) -> Sensor:
        """Return the sensor with a serial number or at a USB port; UnpluggedError or CameraError with what is there."""
        by_port = [sensor for sensor in self.sensors if sensor.port == name]
        found = by_port or [sensor for sensor in self.sensors if name in sensor.serials]
        if len(found) == 1:
            return found[0]
        if found:
            raise CameraError(
                f"{len(found)} sensors have the serial number {name}: name the USB port, {_either(found, by_port=True)}"
            )
        there = _either(self.sensors) or "none is plugged in"
        raise UnpluggedError(f"no sensor is called {name} (there: {there}): check the cable; {_LIST}")

    @property
    def empty(self) -> bool:
        """Whether nothing at all was found."""
        return not (self.cameras or self.rings or self.sensors)

    def url_of(self, sensor: Sensor) -> str:
        """Return the URL that opens this sensor and no other that is plugged in."""
        named = [other for other in self.sensors if sensor.name in {other.port, *other.serials}]
        return f"sensor://{sensor.name if len(named) == 1 else sensor.port}"

    def only(self) -> Sensor:
        """Return the one sensor there is; CameraError lists what else is there and how to name it."""
        if len(self.sensors) == 1:
            return self.sensors[0]
        if self.sensors:
            choice = " or ".join(self.url_of(sensor) for sensor in self.sensors)
            raise CameraError(f"{len(self.sensors)} sensors are plugged in: choose {choice}")
        if self.empty:
            raise UnpluggedError(
                f"{NOTHING}: check the cable, or take the simulated sensor (--sensor sim://); `gellight demo` shows it"
            )
        cameras, rings = (", ".join(node.stable for node in nodes) or "none" for nodes in (self.cameras, self.rings))
        remedy = "plug both into one hub of their own"
        if self.cameras and self.rings:
            remedy += f", or name them with v4l2://{self.cameras[0].stable}?ring={self.rings[0].stable}"
        raise UnpluggedError(
            f"no camera shares a USB parent with a light ring: cameras {cameras}, rings {rings}: {remedy}; {_LIST}"
        )

    def of_camera(self, path: str) -> Sensor:
        """Return the sensor, or the camera alone, at a device node or a link to one; UnpluggedError without one."""
        node = str(Path(path).resolve())
        for sensor in self.with_cameras():
            if node == str(Path(sensor.camera.path).resolve()):
                return sensor
        if os.path.exists(node):  # noqa: PTH110  (a name may be too long for a file)
            cameras = " or ".join(sensor.camera.path for sensor in self.with_cameras()) or "none is there"
            raise UnpluggedError(
                f"{path} takes no pictures: cameras have a second node for data about them; take {cameras}; {_LIST}"
            )
        raise UnpluggedError(f"no camera at {path}: plug it in; {_LIST}")

    def has_own_serial(self, sensor: Sensor) -> bool:
        """Whether no other sensor or camera that is plugged in has the same serial number."""
        return bool(sensor.serial) and len(self._alike(sensor)) == 1

    def again(self, sensor: Sensor, *, by_serial: bool) -> Sensor:
        """Find the same physical sensor by its serial number, or by its USB port where that number is not its own.

        Raises UnpluggedError while it is not there.
        """
        alike = self._alike(sensor)
        found = alike if by_serial and len(alike) == 1 else [other for other in alike if other.port == sensor.port]
        if not found:
            raise UnpluggedError(f"sensor {sensor.name} is not there: plug it in again")
        return found[0]

    def _alike(self, sensor: Sensor) -> list[Sensor]:
        """Everything of the kind and the serial number of `sensor`; rings do not count where it has none."""
        known = self.with_cameras() if sensor.ring else [replace(other, ring=None) for other in self.with_cameras()]
        return [other for other in known if _same_kind(other, sensor) and other.serial == sensor.serial]

    def with_cameras(self) -> list[Sensor]:
        """Return the sensors, and the cameras without a ring as sensors of their own."""
        return [*self.sensors, *(Sensor(camera=camera, ring=None) for camera in self.cameras)]


def discover(*, sysfs: Path = SYSFS, dev: Path = DEV) -> Discovery:
    """Look at everything that is plugged in now."""
    cameras = tuple(_told_apart(list(_cameras(sysfs, dev)), dev / "v4l"))
    rings = tuple(_told_apart(list(_rings(sysfs, dev)), dev / "serial"))
    sensors, ambiguities = _paired(cameras, rings)
    paired = {node.path for sensor in sensors for node in sensor.nodes}
    alone = tuple(node for node in cameras if node.path not in paired)
    return Discovery(
        sensors=sensors,
        cameras=alone,
        rings=tuple(node for node in rings if node.path not in paired),
        ambiguities=(*ambiguities, *_shared_serials(sensors), *_shared_by_cameras(alone)),
    )


def _paired(cameras: tuple[Node, ...], rings: tuple[Node, ...]) -> tuple[tuple[Sensor, ...], tuple[str, ...]]:
    """Pair what is one USB device, then what is alone together behind a hub."""
    sensors: list[Sensor] = []
    ambiguities: list[str] = []
    for key in (_port, _hub):
        taken = {node.path for sensor in sensors for node in sensor.nodes}
        groups: dict[str, tuple[list[Node], list[Node]]] = {}
        for index, nodes in enumerate((cameras, rings)):
            for node in nodes:
                if node.path not in taken and key(node):
                    groups.setdefault(key(node), ([], []))[index].append(node)
        for place, (seen, lit) in groups.items():
            if len(seen) == len(lit) == 1:
                sensors.append(Sensor(camera=seen[0], ring=lit[0]))
            elif seen and lit:
                nodes_text = ", ".join(node.stable for node in (*seen, *lit))
                ambiguities.append(
                    f"at USB {place} are {len(seen)} cameras and {len(lit)} rings ({nodes_text}), and which belong "
                    "together cannot be told: give each sensor a hub of its own, or name them with v4l2://...?ring="
                )
    return tuple(sensors), tuple(ambiguities)


def _port(node: Node) -> str:
    return node.usb.port if node.usb else ""


def _hub(node: Node) -> str:
    return node.usb.parent if node.usb and not node.usb.parent.startswith("usb") else ""


def _shared_serials(sensors: tuple[Sensor, ...]) -> Iterator[str]:
    for serial, count in Counter(sensor.serial for sensor in sensors if sensor.serial).items():
        if count > 1:
            alike = [sensor for sensor in sensors if sensor.serial == serial]
            yield f"{count} sensors have the serial number {serial}: tell them apart as {_either(alike, by_port=True)}"


def _shared_by_cameras(cameras: tuple[Node, ...]) -> Iterator[str]:
    for (*_, serial), count in Counter(map(_identity, cameras)).items():
        if serial and count > 1:
            alike = " or ".join(f"v4l2://{node.stable}" for node in cameras if _identity(node)[-1] == serial)
            yield f"{count} cameras have the serial number {serial}: tell them apart by their ports, as {alike}"


def _identity(node: Node) -> tuple[int, int, str]:
    """Vendor, product and serial number, of which udev makes the link by-id."""
    return (node.usb.vendor, node.usb.product, node.usb.serial) if node.usb else (0, 0, "")


def _told_apart(nodes: list[Node], links: Path) -> Iterator[Node]:
    """Yield the nodes; a link by-id that several claim is of the one that was plugged in last, so they go by port."""
    counts = Counter(_identity(node) for node in nodes)
    for node in nodes:
        alone = counts[_identity(node)] == 1 or not (node.usb and node.usb.serial)
        yield node if alone else replace(node, stable=_stable(Path(node.path), links, "by-path"))


def _stable(path: Path, links: Path, *kinds: str) -> str:
    """Return the first link of these kinds to a node, or else the node."""
    found = (link for kind in kinds for link in sorted((links / kind).glob("*")))
    return str(next((link for link in found if link.resolve() == path.resolve()), path))


def _same_kind(one: Sensor, other: Sensor) -> bool:
    """Whether both have the same vendor and product; what is not on USB is alike if its node is."""
    a, b = one.camera.usb, other.camera.usb
    if a is None or b is None:
        return a is b and one.camera.path == other.camera.path
    return (a.vendor, a.product) == (b.vendor, b.product) and (one.ring is None) == (other.ring is None)


def _either(sensors: tuple[Sensor, ...] | list[Sensor], *, by_port: bool = False) -> str:
    return " or ".join(f"sensor://{sensor.port if by_port else sensor.name}" for sensor in sensors)


# ---- sysfs ----


def _cameras(sysfs: Path, dev: Path) -> Iterator[Node]:
    """Yield the nodes that deliver pictures: a UVC camera's node with index 1 delivers only data about them."""
    for entry in _class(sysfs, "video4linux", "video"):
        if attribute(entry / "index") in ("0", ""):
            yield _node(entry, dev, dev / "v4l", name=attribute(entry / "name"))


def _rings(sysfs: Path, dev: Path) -> Iterator[Node]:
    for entry in _class(sysfs, "tty", "ttyACM"):
        node = _node(entry, dev, dev / "serial", name="")
        if node.usb and is_board(node.usb.vendor, node.usb.product, node.usb.product_name):
            yield node


def _class(sysfs: Path, name: str, prefix: str) -> list[Path]:
    entries = [entry for entry in (sysfs / "class" / name).glob(f"{prefix}*") if entry.name[len(prefix) :].isdigit()]
    return sorted(entries, key=lambda entry: int(entry.name[len(prefix) :]))


def _node(entry: Path, dev: Path, links: Path, *, name: str) -> Node:
    usb, path = _usb_device(entry.resolve()), dev / entry.name
    stable = _stable(path, links, "by-id", "by-path")
    return Node(path=str(path), stable=stable, name=name or (usb.name if usb else ""), usb=usb)


def _usb_device(place: Path) -> UsbDevice | None:
    """Return the USB device that a folder of sysfs belongs to."""
    for folder in (place, *place.parents):
        if (folder / "idVendor").is_file() and (folder / "idProduct").is_file():
            return UsbDevice(
                port=folder.name,
                vendor=int(attribute(folder / "idVendor") or "0", 16),
                product=int(attribute(folder / "idProduct") or "0", 16),
                serial=attribute(folder / "serial"),
                product_name=attribute(folder / "product"),
                name=" ".join(filter(None, (attribute(folder / "manufacturer"), attribute(folder / "product")))),
                speed_mbps=float(attribute(folder / "speed") or 0),
                parent=folder.parent.name,
            )
    return None


def attribute(path: Path) -> str:
    """Return the content of a file in sysfs; empty where there is none, or where its device goes in this moment."""
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""
