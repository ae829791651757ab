"""USB/IP: URBs to and from a kernel, their wire format, and the cable that they go through.

Source: Documentation/usb/usbip_protocol.rst of the Linux kernel. All numbers are big-endian; the eight bytes of a
setup packet are as on the bus. Only bulk, interrupt and control transfers; none of our endpoints is isochronous.

Every URB is answered exactly once. Taking it from its queue and answering it happen under one lock, and so do unlinking
and the answer to that: otherwise the kernel could see an answer to an URB that it has just taken back, and drop the
device.
"""

import contextlib
import socket
import struct
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass

from gellight.ring.transport import PRODUCT, VENDOR
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


BUFFER_BYTES = 1 << 20


class CablePulledError(Exception):
    """The cable is out. It ends the threads that serve the device, and reaches no user."""


class UsbCable:
    """A cable that is plugged in, until `pull`."""

    def __init__(self, connection: socket.socket) -> None:
        """Take over a connected stream socket whose other end a kernel reads."""
        self._socket = connection
        for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
            connection.setsockopt(socket.SOL_SOCKET, option, BUFFER_BYTES)
        if connection.family in (socket.AF_INET, socket.AF_INET6):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._waiting: defaultdict[int, deque[Urb]] = defaultdict(deque)
        self._changed = threading.Condition()
        self.plugged = True

    def run(self, control: Callable[[Urb], bytes | None], outgoing: Callable[[Urb], None]) -> None:
        """Serve until the cable is pulled on either side.

        `control` answers a control transfer (None: stall); `outgoing` takes the data of an OUT endpoint.
        """
        with contextlib.suppress(OSError, ValueError, CablePulledError):
            while self.plugged:
                request = read_request(self._socket)
                if isinstance(request, Unlink):
                    self._unlink(request)
                elif request.endpoint == 0:
                    self._answer_control(request, control(request))
                elif request.incoming:
                    with self._changed:
                        self._waiting[request.endpoint].append(request)
                        self._changed.notify_all()
                else:
                    outgoing(request)
                    self._answer(pack_return(request.number, length=len(request.data)))
        self.pull()

    def pull(self) -> None:
        """Pull the plug; whoever waits gets CablePulledError. A second pull does nothing."""
        with self._changed:
            self.plugged = False
            self._changed.notify_all()
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def send(self, endpoint: int, data: bytes, *, wanted: Callable[[], bool], ended: bool = True) -> None:
        """Send one transfer to the kernel through as many URBs as it takes, while `wanted` is true.

        A short URB ends a transfer; where the last one is full an empty one is added if `ended`.
        """
        rest, full = memoryview(data), False
        while rest or (full and ended):
            taken = self._send_part(endpoint, rest, wanted)
            if taken is None or taken[0] < taken[1]:
                return
            rest, full = rest[taken[0] :], True

    def _send_part(self, endpoint: int, data: memoryview, wanted: Callable[[], bool]) -> tuple[int, int] | None:
        """Answer the next URB of an endpoint; return the bytes sent and its size, None when not wanted any more."""
        with self._changed:
            while not self._waiting[endpoint]:
                if not self.plugged:
                    raise CablePulledError
                if not wanted():
                    return None
                self._changed.wait(0.1)
            if not wanted():
                return None
            urb = self._waiting[endpoint].popleft()
            part = data[: urb.length]
            self._answer(pack_return(urb.number, data=part))
            return len(part), urb.length

    def sleep_until(self, time_s: float, wanted: Callable[[], bool]) -> bool:
        """Sleep until a time of `time.monotonic`; return False at once where `wanted` ends before that.

        Raises CablePulledError.
        """
        with self._changed:
            while self.plugged and wanted():
                left = time_s - time.monotonic()
                if left <= 0:
                    return True
                self._changed.wait(min(left, 0.05))
            if not self.plugged:
                raise CablePulledError
            return False

    def _unlink(self, request: Unlink) -> None:
        with self._changed:
            found = [(queue, urb) for queue in self._waiting.values() for urb in queue if urb.number == request.victim]
            for queue, urb in found:
                queue.remove(urb)
            self._answer(pack_unlinked(request.number, found=bool(found)))

    def _answer_control(self, urb: Urb, reply: bytes | None) -> None:
        if reply is None:
            self._answer(pack_return(urb.number, status=STALL))
        elif urb.incoming:
            self._answer(pack_return(urb.number, data=reply[: urb.length]))
        else:
            self._answer(pack_return(urb.number, length=len(urb.data)))

    def _answer(self, packet: bytes) -> None:
        with self._changed:
            if not self.plugged:
                raise CablePulledError
            try:
                self._socket.sendall(packet)
            except OSError:
                raise CablePulledError from None
