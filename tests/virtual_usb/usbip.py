"""The wire format of USB/IP: which devices are offered, and the URBs of one that is imported.

Source: Documentation/usb/usbip_protocol.rst of the Linux kernel. All numbers are big-endian; the eight bytes of a
setup packet are as on the bus. Only bulk, interrupt and control transfers; none of our endpoints is isochronous.
"""

import socket
import struct
from dataclasses import dataclass

from gellight.ring.usb_numbers import PRODUCT, VENDOR
from tests.virtual_usb.descriptors import COMPOSITE, INTERFACES, RELEASE

VERSION = 0x0111
REQUEST_IMPORT, REPLY_IMPORT = 0x8003, 0x0003
SUBMIT, UNLINK, RETURN_SUBMIT, RETURN_UNLINK = 1, 2, 3, 4
HIGH_SPEED = 3
STALL, CANCELLED = -32, -104
"""-EPIPE, -ECONNRESET: the status of an URB that the endpoint refused, and of one that was unlinked"""

_OPERATION = struct.Struct(">HHI")
_DEVICE = struct.Struct(">256s32sIIIHHHBBBBBB")
_HEADER = struct.Struct(">IIIII")
_SUBMIT = struct.Struct(">Iiiii8s")
_RETURN = struct.Struct(">IIIIIiiiii8x")
_UNLINKED = struct.Struct(">IIIIIi24x")
BUS_ID_BYTES = 32
HEADER_BYTES = 48


@dataclass(frozen=True)
class Urb:
    """A transfer that the kernel submitted."""

    number: int
    incoming: bool
    """towards the kernel"""
    endpoint: int
    length: int
    setup: bytes
    data: bytes = b""


@dataclass(frozen=True)
class Unlink:
    """The kernel wants a submitted URB back."""

    number: int
    victim: int


def receive(connection: socket.socket, count: int) -> bytes:
    """Return exactly `count` bytes; ConnectionError at the end of the stream."""
    data = bytearray()
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise ConnectionError("the other side of the USB/IP connection has closed it")
        data += part
    return bytes(data)


def read_import(connection: socket.socket) -> str:
    """Return the bus id that an importer asks for; ValueError for anything else."""
    version, code, _status = _OPERATION.unpack(receive(connection, _OPERATION.size))
    if version != VERSION:
        raise ValueError(f"the importer speaks USB/IP {version:04x}, this is {VERSION:04x}")
    if code != REQUEST_IMPORT:
        raise ValueError(f"operation {code:04x} is no import")
    return receive(connection, BUS_ID_BYTES).rstrip(b"\0").decode("ascii", "replace")


def _described(bus_id: str) -> bytes:
    """Return the 312 bytes that describe a virtual sensor to importers."""
    bus, device, configuration, configurations = 1, 1, 1, 1
    return _DEVICE.pack(
        f"/sys/devices/gellight/{bus_id}".encode(), bus_id.encode(), bus, device, HIGH_SPEED, VENDOR, PRODUCT, RELEASE,
        *COMPOSITE, configuration, configurations, len(INTERFACES),
    )  # fmt: skip


def pack_import(bus_id: str | None) -> bytes:
    """Return the reply to an import; None: refused."""
    return _OPERATION.pack(VERSION, REPLY_IMPORT, int(bus_id is None)) + (_described(bus_id) if bus_id else b"")


def read_request(connection: socket.socket) -> Urb | Unlink:
    """Return what the kernel asks next; ConnectionError at the end, ValueError for what is no URB of ours."""
    head = receive(connection, HEADER_BYTES)
    command, number, _device, direction, endpoint = _HEADER.unpack_from(head)
    if command == UNLINK:
        return Unlink(number, int(struct.unpack_from(">I", head, _HEADER.size)[0]))
    if command != SUBMIT:
        raise ValueError(f"command {command} is neither a submit nor an unlink")
    _flags, length, _start, packets, _interval, setup = _SUBMIT.unpack_from(head, _HEADER.size)
    if length < 0 or packets not in (0, -1):
        raise ValueError(f"an URB of {length} bytes and {packets} isochronous packets for endpoint {endpoint}")
    data = receive(connection, length) if not direction and length else b""
    return Urb(number, bool(direction), endpoint, length, setup, data)


def pack_return(number: int, *, status: int = 0, length: int = 0, data: bytes | memoryview = b"") -> bytes:
    """Return the answer to an URB: `data` of a transfer towards the kernel, or the `length` that was taken."""
    size = len(data) or length
    return _RETURN.pack(RETURN_SUBMIT, number, 0, 0, 0, status, size, 0, 0, 0) + bytes(data)


def pack_unlinked(number: int, *, found: bool) -> bytes:
    """Return the answer to an unlink; an URB that was not found had been answered before."""
    return _UNLINKED.pack(RETURN_UNLINK, number, 0, 0, 0, CANCELLED if found else 0)
