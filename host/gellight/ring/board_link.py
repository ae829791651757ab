"""Requests to the board, with retries, and the events it sends by itself; the commands themselves: light_ring.py."""

import logging
import time
from collections import deque
from collections.abc import Callable
from typing import TypeVar

from gellight.base.errors import BoardError
from gellight.base.locking import FairLock
from gellight.ring import protocol
from gellight.ring.enumerations import Status
from gellight.ring.transport import SilentError, Transport
from gellight.ring.wire import Packet, Record, decode, encode

logger = logging.getLogger(__name__)
R = TypeVar("R", bound=Record)

SLICE_S = 0.05
"""who waits for an event lets others in so often"""

REMEDIES = {
    Status.UNKNOWN_COMMAND: "flash the firmware that belongs to this host with `gellight firmware flash`",
    Status.BAD_LENGTH: "flash the firmware that belongs to this host with `gellight firmware flash`",
    Status.OUT_OF_RANGE: "see docs/protocol.md for what is allowed",
    Status.OVER_CURRENT: "dim the LEDs, or raise the limit",
    Status.BUSY: "stop the sequence or wait until the LEDs are as asked",
    Status.NOT_RUNNING: "commit and start a sequence first",
    Status.WRONG_MODE: "choose the mode with set_sync first",
    Status.CHECKSUM: "send groups and steps again, then commit",
    Status.BAD_MAGIC: "this is a mistake of the program, please report it",
    Status.FLASH_FAILED: "the flash of the board is worn out or not powered well; its configuration was not saved",
    Status.SAVED_TOO_OFTEN: "its flash wears out: save again after that number of seconds",
}


class RefusedError(BoardError):
    """The board refused a request; `status` says why and `value` what."""

    def __init__(self, command: str, status: Status, value: int) -> None:
        """Say what was refused and what to do."""
        super().__init__(f"the board refused {command}: {status.name} ({value}); {REMEDIES[status]}")
        self.status, self.value = status, value


class BoardLink:
    """A board that has said hello: sends requests, receives replies and events. Several threads may use it."""

    def __init__(self, transport: Transport, *, timeout_s: float, attempts: int) -> None:
        """Say hello; BoardError, with the transport closed, where nobody answers or the protocol is another one."""
        self.transport = transport
        self.timeout_s, self.attempts = timeout_s, attempts
        """how often a request is sent, and how long it waits for its reply each time, whatever else comes"""
        self._monotonic: Callable[[], float] = getattr(transport, "monotonic", time.monotonic)
        """a board that is emulated step by step has a time of its own"""
        self.retries = 0
        self.damaged = 0
        """packets from the board that could not be read"""
        self.events: deque[Record] = deque(maxlen=4096)
        self.event_listeners: list[Callable[[Record], None]] = []
        """called with every event in the order of the board, in the thread that received it, which holds the lock"""
        self._lock = FairLock()
        """held while a request waits for its reply, so for a second at most"""
        self._sequence = 0
        self._partial = b""
        self._packets: deque[Packet] = deque()
        try:
            transport.write(b"\0")  # ends whatever somebody else left half sent
            self.hello = self._greet()
        except BaseException:
            transport.close()
            raise

    def _greet(self) -> protocol.HelloReply:
        """Only another major version is refused: within one, either side knows what it does not need to know."""
        hello = self._request("HELLO", protocol.HelloReply)
        theirs, ours = (hello.protocol_major, hello.protocol_minor), protocol.VERSION
        if theirs[0] != ours[0]:
            age, update = ("too new", "update GelLight, or ") if theirs > ours else ("too old", "")
            raise BoardError(
                f"the firmware of the board is {age}: it speaks protocol {theirs[0]}.{theirs[1]}, this host "
                f"{ours[0]}.{ours[1]}: {update}run `gellight firmware flash`"
            )
        if hello.schema_crc != protocol.schema_crc():
            logger.info("the board speaks protocol %s.%s, this host %s.%s: they use what both know", *theirs, *ours)
        return hello

    def _request(self, name: str, reply: type[R], record: Record | None = None) -> R:
        """Send a request until its reply comes; the board executes it once, however often it is sent."""
        code = protocol.COMMANDS[name].code
        with self._lock:
            self._sequence = self._sequence + 1 & 0xFF
            packet = Packet(code, self._sequence, record.pack() if record else b"")
            for attempt in range(self.attempts):
                if attempt:
                    self.retries += 1
                    self.transport.write(b"\0")
                self.transport.write(encode(packet))
                answer = self._await_reply(code | protocol.REPLY, self._sequence)
                if answer is not None:
                    status, value = answer.payload[0], int.from_bytes(answer.payload[1:5], "little")
                    if status not in set(Status):
                        raise BoardError(
                            f"the board answers {name} with status {status}, which this host does not know: update "
                            "GelLight, or flash the firmware that belongs to it with `gellight firmware flash`"
                        )
                    if status != Status.OK:
                        raise RefusedError(name, Status(status), value)
                    return reply.unpack(answer.payload[5:])
        raise SilentError(
            f"the board at {self.transport.url} did not answer {name} in {self.attempts} attempts of "
            f"{self.timeout_s} s: unplug it and plug it in again"
        )

    def _await_reply(self, code: int, sequence: int) -> Packet | None:
        """Return the reply, None after `timeout_s` without it; what has arrived by then is looked at all the same."""
        end_s = self._monotonic() + self.timeout_s
        expired = False
        while True:
            while self._packets:
                packet = self._packets.popleft()
                if (packet.type, packet.sequence) == (code, sequence) and len(packet.payload) >= 5:
                    return packet
            if expired:
                return None
            left_s = end_s - self._monotonic()
            expired = left_s <= 0
            if not self._receive(max(0.0, left_s)):
                return None

    def _receive(self, timeout_s: float) -> bool:
        """Take bytes from the transport and sort the packets in them; False if none came in time."""
        data = self.transport.read(timeout_s)
        self._partial += data
        *whole, self._partial = self._partial.split(b"\0")
        for stuffed in filter(None, whole):
            self._sort(stuffed)
        return bool(data)

    def _sort(self, stuffed: bytes) -> None:
        try:
            packet = decode(stuffed)
        except ValueError:
            self.damaged += 1
            return
        if packet.type & protocol.REPLY:
            self._packets.append(packet)
            return
        for code, record in protocol.EVENTS.values():
            if code == packet.type:
                try:
                    event = record.unpack(packet.payload)
                except BoardError:
                    self.damaged += 1
                    return
                self._take_event(event)

    def _take_event(self, event: Record) -> None:
        self.events.append(event)
        for listener in tuple(self.event_listeners):
            listener(event)

    def _wait_for_event(self, wanted: Callable[[Record], bool], timeout_s: float) -> Record | None:
        """Return the first wanted event, None after `timeout_s`; meanwhile other threads send their requests."""
        end_s = self._monotonic() + timeout_s
        while True:
            with self._lock:
                found = next(filter(wanted, self.events), None)
                left_s = end_s - self._monotonic()
                if found is not None or left_s <= 0:
                    return found
                self._receive(min(SLICE_S, left_s))
