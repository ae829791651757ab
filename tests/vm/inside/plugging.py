"""What the guest can be asked to do with its own kernel: plug in, look around, wait. Runs in the guest."""

import socket
import struct
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.vm.inside.agent import MACHINE

VIDEO, SERIAL = Path("/dev/v4l/by-id"), Path("/dev/serial/by-id")
USB = Path("/sys/bus/usb/devices")
NODES = ("*/tty/ttyACM*", "*/video4linux/video*")
CONTROLLER = Path("/sys/devices/platform/vhci_hcd.0")
"""the kernel's virtual USB host controller"""
FREE = 4
"""state of one of its ports without a device (VDEV_ST_NULL)"""


def receive(connection: socket.socket, count: int) -> bytes:
    """Return exactly `count` bytes."""
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise ConnectionError("the device is gone")
        data += part
    return data


def import_device(connection: socket.socket, bus_id: str) -> tuple[int, int]:
    """Import a device that a server offers over USB/IP; return its device id and speed, as vhci-hcd wants them."""
    connection.sendall(struct.pack(">HHI32s", 0x0111, 0x8003, 0, bus_id.encode()))
    version, code, status = struct.unpack(">HHI", receive(connection, 8))
    assert (version, code) == (0x0111, 0x0003)
    if status:
        raise ConnectionRefusedError(f"no free device {bus_id!r} is offered")
    bus, number, speed = struct.unpack_from(">III", receive(connection, 312), 256 + 32)
    return bus << 16 | number, speed


def port_name(port: int) -> str:
    """Return what the kernel calls the device in a port of the virtual controller, the guest's only one."""
    return f"1-{port + 1}"


def wait_for(condition: Callable[[], Any], what: str, limit_s: float = 20.0) -> Any:
    """Return the first true value of `condition`; TimeoutError says what did not happen."""
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise TimeoutError(f"{what}: not within {limit_s:g} s")


def video_link(serial: str) -> Path:
    """Return the link of a sensor's camera."""
    return VIDEO / f"usb-GelLight_GelLight_virtual_sensor_{serial}-video-index0"


def serial_link(serial: str) -> Path:
    """Return the link of a sensor's light ring."""
    return SERIAL / f"usb-GelLight_GelLight_virtual_sensor_{serial}-if00"


def plug(server: int, bus_id: str, serial: str, port: int) -> dict[str, Any]:
    """Plug a sensor that the machine offers into a USB port; wait for what udev makes of it."""
    with socket.create_connection((MACHINE, server)) as connection:
        device, speed = import_device(connection, bus_id)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        attached_s = time.monotonic()
        (CONTROLLER / "attach").write_text(f"{port} {connection.fileno()} {device} {speed}")
    wait_for(lambda: all(any(USB.glob(f"{port_name(port)}/{node}")) for node in NODES), f"drivers for port {port}")
    wait_for(lambda: video_link(serial).exists() and serial_link(serial).exists(), f"the links of {serial}")
    seconds = time.monotonic() - attached_s
    settle()
    return {"seconds": seconds, "attached_s": attached_s, "links": links()}


def settle() -> None:
    """Wait until udev has done all that the kernel told it."""
    subprocess.run(["udevadm", "settle", "--timeout=20"], check=True)


def unplugged(port: int) -> None:
    """Wait until the kernel has let go of what was in a USB port."""

    def is_free() -> bool:
        rows = [line.split() for line in (CONTROLLER / "status").read_text().splitlines()]
        return any(row[0] == "hs" and int(row[1]) == port and int(row[2]) == FREE for row in rows if row)

    wait_for(is_free, f"port {port} empty")
    settle()


def links() -> list[str]:
    """Return all links by id and path to cameras and serial ports."""
    found = (path for kind in ("v4l", "serial") for path in Path("/dev", kind).glob("by-*/*"))
    return sorted(f"{path} -> {path.resolve()}" for path in found)


def owners(serial: str) -> dict[str, list[str]]:
    """Return group and permissions of a sensor's nodes."""
    nodes = {"camera": video_link(serial), "ring": serial_link(serial)}
    return {name: [node.group(), f"{node.stat().st_mode & 0o777:o}"] for name, node in nodes.items()}


def clock_offset(server: int, rounds: int = 60) -> float:
    """Return how much this clock is ahead of the machine's, s, from the quickest of many questions to it."""
    with socket.create_connection((MACHINE, server)) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        found = [_asked(connection) for _ in range(rounds)]
    return min(found)[1]


def _asked(connection: socket.socket) -> tuple[float, float]:
    asked_s = time.monotonic()
    connection.sendall(b"?")
    (theirs_s,) = struct.unpack(">d", receive(connection, 8))
    answered_s = time.monotonic()
    return answered_s - asked_s, (asked_s + answered_s) / 2 - theirs_s
