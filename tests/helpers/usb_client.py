"""The kernel's end of a USB/IP cable, as small as it can be: for tests of the virtual sensor without a kernel.

The layouts are written out here a second time, from the same documents as those of the sensor: what both sides got from
one place could be wrong on both.
"""

import itertools
import socket
import struct
import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

from tests.helpers.scripted_camera import ScriptedCamera, ScriptedControls

MJPG, YUYV = 1, 2
CAMERA, PROCESSING = 0x0102, 0x0202
"""wIndex of the two units: unit in the high byte, interface 2 in the low one"""


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


class CardCamera(ScriptedCamera):
    """Shows a colour card as its controls say."""

    def __init__(self) -> None:
        y, x = np.indices((48, 64))
        self.card = np.stack([40 + x, 60 + y, 150 - x], axis=2).astype(np.uint8)
        self._gains = np.ones(3)
        controls = ScriptedControls(self._develop)
        super().__init__(self._picture, shape=(48, 64), period_s=1 / 200, url="card", controls=controls)

    def _develop(self, exposure_us: float, channel_gain: tuple[float, float, float]) -> None:
        self._gains = np.array(channel_gain) * exposure_us / 8000.0

    def _picture(self, number: int) -> np.ndarray:
        return np.clip(np.rint(self.card * self._gains), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Reply:
    """What came back for an URB or an unlink."""

    number: int
    status: int
    length: int
    data: bytes


@dataclass(frozen=True)
class Payload:
    """One picture as it came over the bus."""

    flags: int
    data: bytes


class UsbClient:
    """Submits URBs over a socket and collects the answers."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        connection.settimeout(5.0)
        self._numbers = itertools.count(1)
        self._incoming: set[int] = set()
        self._early: deque[Reply] = deque()
        self.sending = threading.Lock()

    def submit(self, endpoint: int, *, incoming: bool, length: int, setup: bytes = bytes(8), data: bytes = b"") -> int:
        number = next(self._numbers)
        if incoming:
            self._incoming.add(number)
        head = struct.pack(">IIIII", 1, number, 0x10001, int(incoming), endpoint)
        self.socket.sendall(head + struct.pack(">IiiiI8s", 0, length, 0, 0, 0, setup) + data)
        return number

    def unlink(self, victim: int) -> int:
        number = next(self._numbers)
        self.socket.sendall(struct.pack(">IIIIII24x", 2, number, 0x10001, 0, 0, victim))
        return number

    def reply(self, number: int | None = None) -> Reply:
        """Return the answer to one URB, or the next there is; others wait for their turn."""
        for early in self._early:
            if number in (None, early.number):
                self._early.remove(early)
                return early
        while True:
            reply = self._receive()
            if number in (None, reply.number):
                return reply
            self._early.append(reply)

    def _receive(self) -> Reply:
        command, number, _device, _direction, _endpoint, status, length = struct.unpack_from(
            ">IIIIIiI", receive(self.socket, 48)
        )
        has_data = command == 3 and number in self._incoming
        return Reply(number, status, length, receive(self.socket, length) if has_data else b"")

    # ---- control transfers ----

    def get(self, kind: int, code: int, value: int, index: int, length: int) -> Reply:
        setup = struct.pack("<BBHHH", kind | 0x80, code, value, index, length)
        return self.reply(self.submit(0, incoming=True, length=length, setup=setup))

    def set(self, kind: int, code: int, value: int, index: int, data: bytes = b"") -> Reply:
        setup = struct.pack("<BBHHH", kind, code, value, index, len(data))
        return self.reply(self.submit(0, incoming=False, length=len(data), setup=setup, data=data))

    def descriptor(self, kind: int, index: int = 0) -> bytes:
        return self.get(0, 6, kind << 8 | index, 0, 4096).data

    def control(self, unit: int, selector: int, size: int) -> int:
        return int.from_bytes(self.get(0x21, 0x81, selector << 8, unit, size).data, "little")

    def set_control(self, unit: int, selector: int, size: int, value: int) -> int:
        """Return the status: 0, or -32 where the device refuses."""
        return self.set(0x21, 0x01, selector << 8, unit, value.to_bytes(size, "little")).status

    # ---- video ----

    def start(self, picture_format: int = MJPG, size_index: int = 1, interval: int = 0) -> tuple[int, int, int]:
        """Probe and commit; return format, size and interval that the device chose."""
        block = struct.pack("<HBBI", 1, picture_format, size_index, interval).ljust(34, b"\0")
        assert self.set(0x21, 0x01, 0x0100, 3, block).status == 0
        probed = self.get(0x21, 0x81, 0x0100, 3, 34).data
        assert self.set(0x21, 0x01, 0x0200, 3, probed).status == 0
        _, chosen, size, period = struct.unpack_from("<HBBI", probed)
        return chosen, size, period

    def stop(self) -> None:
        assert self.set(0x02, 0x01, 0, 0x83).status == 0

    def payload(self, *, urb_bytes: int = 1024) -> Payload:
        """Receive one picture; a short URB ends it."""
        data = b""
        while True:
            part = self.reply(self.submit(3, incoming=True, length=urb_bytes)).data
            data += part
            if len(part) < urb_bytes:
                return Payload(data[1], data[data[0] :])
