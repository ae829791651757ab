"""The cable between a kernel and the virtual device: URBs wait here until an endpoint has something for them.

Every URB is answered exactly once. Taking it from its queue and answering it happen under one lock, and so do unlinking
and the answer to that: otherwise the kernel could see an answer to an URB that it has just taken back, and drop the
device.
"""

import contextlib
import socket
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable

from tests.virtual_usb.usbip import STALL, Unlink, Urb, pack_return, pack_unlinked, read_request

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
