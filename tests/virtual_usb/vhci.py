"""Plug a virtual sensor into this Linux: its virtual USB host controller, the kernel module vhci-hcd."""

import os
import socket
from pathlib import Path

CONTROLLER = Path("/sys/devices/platform/vhci_hcd.0")
FREE = 4
"""state of a port without a device (VDEV_ST_NULL)"""


def high_speed_ports(status: str) -> dict[int, bool]:
    """Return the ports for high-speed devices, by number, and whether each is free; `status` is the kernel's table."""
    rows = [line.split() for line in status.splitlines()]
    return {int(row[1]): int(row[2]) == FREE for row in rows if row and row[0] == "hs"}


def attach(connection: socket.socket, port: int, *, device_id: int, speed: int, controller: Path = CONTROLLER) -> None:
    """Give the kernel its end of a connection to a device; the socket may be closed afterwards.

    Raises OSError when the kernel refuses it.
    """
    descriptor = os.open(controller / "attach", os.O_WRONLY)
    try:
        os.write(descriptor, f"{port} {connection.fileno()} {device_id} {speed}".encode())
    finally:
        os.close(descriptor)
