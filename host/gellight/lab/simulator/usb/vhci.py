"""Plug a virtual sensor into this Linux: its virtual USB host controller, the kernel module vhci-hcd."""

import os
import socket
from pathlib import Path

from gellight.base.errors import BoardError, first_line
from gellight.lab.simulator.usb.device import VirtualSensor
from gellight.lab.simulator.usb.usbip import HIGH_SPEED

CONTROLLER = Path("/sys/devices/platform/vhci_hcd.0")
FREE = 4
"""state of a port without a device (VDEV_ST_NULL)"""


def high_speed_ports(status: str) -> dict[int, bool]:
    """Return the ports for high-speed devices, by number, and whether each is free; `status` is the kernel's table."""
    rows = [line.split() for line in status.splitlines()]
    return {int(row[1]): int(row[2]) == FREE for row in rows if row and row[0] == "hs"}


def choose_port(wanted: int | None, controller: Path = CONTROLLER) -> int:
    """Return the wanted port, or the first free one; BoardError when there is none, with what to do."""
    require(controller)
    ports = high_speed_ports((controller / "status").read_text())
    free = [port for port, empty in ports.items() if empty]
    if wanted is not None and wanted not in free:
        choices = ", ".join(map(str, free)) or "none"
        raise BoardError(f"virtual USB port {wanted} is not free: choose one of {choices}")
    if not free:
        raise BoardError(f"all {len(ports)} virtual USB ports are taken: end a virtual sensor first")
    return free[0] if wanted is None else wanted


def require(controller: Path = CONTROLLER) -> None:
    """Raise BoardError when a virtual device cannot be plugged into this machine, with the remedy."""
    if not controller.is_dir():
        raise BoardError(
            "this Linux has no virtual USB host controller: sudo modprobe vhci-hcd (Debian and Ubuntu ship it in their "
            "kernel packages), or offer the sensor to another machine with --listen"
        )
    if not os.access(controller / "attach", os.W_OK):
        raise BoardError("only root may plug in virtual USB devices: run it with sudo, or use --listen")


def attach(connection: socket.socket, port: int, *, device_id: int = 0x10001, speed: int = HIGH_SPEED,
           controller: Path = CONTROLLER) -> None:  # fmt: skip
    """Give the kernel its end of a connection to a device; the socket may be closed afterwards.

    Raises BoardError when the kernel refuses it.
    """
    try:
        descriptor = os.open(controller / "attach", os.O_WRONLY)
        try:
            os.write(descriptor, f"{port} {connection.fileno()} {device_id} {speed}".encode())
        finally:
            os.close(descriptor)
    except OSError as error:
        raise BoardError(f"the kernel does not take the virtual device at port {port} ({first_line(error)})") from error


def plug_in(sensor: VirtualSensor, port: int | None = None) -> int:
    """Plug into a virtual USB port (None: the first free one) and return its number.

    Raises BoardError with the remedy when this machine cannot.
    """
    chosen = choose_port(port)
    ours, kernels = socket.socketpair()
    with kernels:
        sensor.plug(ours)
        try:
            attach(kernels, chosen)
        except BaseException:
            sensor.unplug()
            raise
    return chosen
