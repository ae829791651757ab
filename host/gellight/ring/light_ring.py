"""The light ring: typed commands over a transport, with retries; the LEDs are dark when nobody holds it open.

with connect("sim://") as ring:
    ring.set_leds(np.full((12, 3), 40, np.uint8))
"""

import itertools
import logging
import threading
import time
import zlib
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError
from gellight.ring import protocol
from gellight.ring.enumerations import Capability, Dark, Edge, Policy, Status, SyncMode
from gellight.ring.transport import Transport, open_transport
from gellight.ring.wire import COLOUR_BYTES, LED_COUNT, Packet, Record, decode, encode

logger = logging.getLogger(__name__)
R = TypeVar("R", bound=Record)

SILENCE_S = 0.5
"""a board that was heard of within this time has not made its LEDs dark for silence: it waits 1 s for the host"""
LATCH_TIMEOUT_S = 5.0
"""a board latches a light within milliseconds; an emulated one on a busy machine takes longer"""

REMEDIES = {
    Status.UNKNOWN_COMMAND: "flash the firmware that belongs to this host with `gellight firmware flash`",
    Status.BAD_LENGTH: "flash the firmware that belongs to this host with `gellight firmware flash`",
    Status.OUT_OF_RANGE: "see docs/protocol.md for what is allowed",
    Status.OVER_CURRENT: "dim the LEDs, raise the limit, or choose the policy SCALE",
    Status.BUSY: "stop the sequence or wait until the LEDs are as asked",
    Status.NOT_RUNNING: "commit and start a sequence first",
    Status.WRONG_MODE: "choose the mode with set_sync first",
    Status.CHECKSUM: "send groups and steps again, then commit",
    Status.BAD_MAGIC: "this is a mistake of the program, please report it",
    Status.FLASH_FAILED: "the flash of the board is worn out or not powered well; its configuration was not saved",
}


class RefusedError(BoardError):
    """The board refused a request; `status` says why and `value` what."""

    def __init__(self, command: str, status: Status, value: int) -> None:
        """Say what was refused and what to do."""
        super().__init__(f"the board refused {command}: {status.name} ({value}); {REMEDIES[status]}")
        self.status, self.value = status, value


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step of a sequence: which light group, how long lit, how long dark after that."""

    group: int
    dwell_us: int
    blank_us: int = 0
    repeat: int = 1


@dataclass(frozen=True, kw_only=True)
class Ping:
    """Times on both clocks around one request: it was sent before the board received it, and answered after that."""

    host_sent_s: float
    """`time.monotonic` before the request was first sent"""
    board_received_us: int
    board_sent_us: int
    host_received_s: float
    """`time.monotonic` when the reply was there"""


def connect(url: str) -> "LightRing":
    """Open the board at a URL and check that it speaks our protocol."""
    return LightRing(open_transport(url))


class LightRing:
    """A board that has said hello. Close it, or use it in a `with` statement: then its LEDs are dark."""

    def __init__(self, transport: Transport, *, timeout_s: float = 0.25, attempts: int = 4,
                 keep_alive_s: float | None = 0.25) -> None:  # fmt: skip
        """Say hello; `keep_alive_s` None: the caller sends something every second, or the LEDs go dark."""
        self.transport = transport
        self.timeout_s, self.attempts = timeout_s, attempts
        self.retries = 0
        self.damaged = 0
        """packets from the board that could not be read"""
        self.events: deque[Record] = deque(maxlen=4096)
        self.event_listeners: list[Callable[[Record], None]] = []
        """called with every event in the order of the board, in the thread that received it"""
        self.ping_listeners: list[Callable[[Ping], None]] = []
        """called with the clocks after every `clock` and `status`, in the thread that asked"""
        self.still: NDArray[np.uint8] | None = None
        """(12, 3) colours of the last `set_leds`; None before it and after a sequence, a step or `blank`"""
        self._lock = threading.RLock()
        self._sequence = 0
        self._partial = b""
        self._packets: deque[Packet] = deque()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.lit_s = -inf
        """`time.monotonic` when `light` last knew that its light is on; inf: the board has made that light dark"""
        self._dark: Dark | None = None
        """why the board has made its LEDs dark by itself; None: it has not, or they are lit again"""
        self._heard_s = -inf
        """`time.monotonic` of the last answer"""
        try:
            transport.write(b"\0")  # ends whatever somebody else left half sent
            self.hello = self._greet()
        except BaseException:
            transport.close()
            raise
        if keep_alive_s is not None:
            self._thread = threading.Thread(target=self._keep_alive, args=(keep_alive_s,), daemon=True)
            self._thread.start()

    def _greet(self) -> protocol.HelloReply:
        hello = self._request("HELLO", protocol.HelloReply)
        theirs, ours = (hello.protocol_major, hello.protocol_minor), protocol.VERSION
        if hello.schema_crc != protocol.schema_crc():
            age = "too new" if theirs > ours else "too old" if theirs < ours else "of another build"
            update = "update GelLight, or " if theirs > ours else ""
            raise BoardError(
                f"the firmware of the board is {age}: it speaks protocol {theirs[0]}.{theirs[1]} (schema "
                f"{hello.schema_crc:08x}), this host {ours[0]}.{ours[1]} (schema {protocol.schema_crc():08x}): "
                f"{update}run `gellight firmware flash`"
            )
        return hello

    # ---- life ----

    def __enter__(self) -> Self:
        """Return the ring."""
        return self

    def __exit__(self, *_: object) -> None:
        """Make the LEDs dark, whatever happened."""
        self.close()

    def close(self) -> None:
        """Make the LEDs dark and close the transport; a second call does nothing."""
        if self._stop.is_set():
            return
        self._stop.set()
        if self._thread and self._thread is not threading.current_thread():
            self._thread.join()
        try:
            self.blank()
        except BoardError as error:  # the board darkens its LEDs by itself when the port closes or the host is silent
            logger.warning("could not darken the LEDs before closing: %s", error)
        finally:
            self.transport.close()

    def _keep_alive(self, period_s: float) -> None:
        """Ask on after a failure: a machine that was busy for a second comes back, a board that is gone does not."""
        silent = False
        while not self._stop.wait(period_s):
            try:
                self.clock()
                self._light_again()
                silent = False
            except BoardError as error:
                if not silent:
                    logger.warning("the board of the light ring does not answer: %s", error)
                silent = True

    def _light_again(self) -> None:
        """Show the last still light once more where the board has made it dark by itself."""
        with self._lock:
            if self._dark is None:
                return
            why = self._dark.name.replace("_", " ").lower()
            if self.still is None:
                self._dark = None
                logger.warning("the board made its LEDs dark (%s); a sequence that ran has ended", why)
            else:
                self.light(self.still)
                logger.warning("the board made its LEDs dark (%s); they are lit again", why)

    def lit_since_s(self) -> float:
        """Return from when on (`time.monotonic`) the light of the last `light` surely was on until now.

        A board that was not heard of for `SILENCE_S` is asked first, since it may have made its LEDs dark. Then, and
        until they are lit again, this is inf. Raises BoardError where the board does not answer.
        """
        if time.monotonic() - self._heard_s > SILENCE_S:
            self.clock()
        return self.lit_s

    # ---- requests ----

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
                    if status != Status.OK:
                        raise RefusedError(name, Status(status), value)
                    return reply.unpack(answer.payload[5:])
        raise BoardError(
            f"the board at {self.transport.url} did not answer {name} in {self.attempts} attempts of "
            f"{self.timeout_s} s: unplug it and plug it in again"
        )

    def _await_reply(self, code: int, sequence: int) -> Packet | None:
        while True:
            while self._packets:
                packet = self._packets.popleft()
                if (packet.type, packet.sequence) == (code, sequence) and len(packet.payload) >= 5:
                    return packet
            if not self._receive(self.timeout_s):
                return None

    def _receive(self, timeout_s: float) -> bool:
        """Take bytes from the transport and sort the packets in them; False if there were none."""
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
                event = record.unpack(packet.payload)
                if isinstance(event, protocol.DarkEvent):
                    self._dark = Dark(event.dark)
                    self.lit_s = inf if self.still is not None else self.lit_s
                self.events.append(event)
                for listener in tuple(self.event_listeners):
                    listener(event)

    # ---- commands ----

    def clock(self, host_us: int = 0) -> protocol.ClockReply:
        """Return the times of the board's clock (us) around this request."""
        sent_s = time.monotonic()
        reply = self._request("CLOCK", protocol.ClockReply, protocol.ClockRequest(host_us))
        self._tell_ping(sent_s, reply.received_us, reply.sent_us)
        return reply

    def _tell_ping(self, host_sent_s: float, board_received_us: int, board_sent_us: int) -> None:
        ping = Ping(host_sent_s=host_sent_s, board_received_us=board_received_us, board_sent_us=board_sent_us,
                    host_received_s=time.monotonic())  # fmt: skip
        self._heard_s = ping.host_received_s
        for listener in tuple(self.ping_listeners):
            listener(ping)

    def set_leds(self, colours: NDArray[np.uint8]) -> protocol.LightReply:
        """Light the LEDs: colours (12, 3) uint8 RGB; the reply tells current and scale."""
        reply = self._request("SET_LEDS", protocol.LightReply, protocol.SetLeds(colour_bytes(colours)))
        self.still = np.array(colours)
        return reply

    def light(self, colours: NDArray[np.uint8] | None, timeout_s: float = LATCH_TIMEOUT_S) -> int:
        """Show a still light, (12, 3) uint8 RGB, and wait until the LEDs have latched it; return its number.

        None ends a sequence and makes the LEDs dark. Raises BoardError where the board refuses the light, scales it to
        its current limit, or does not latch it.
        """
        with self._lock:
            if colours is None:
                self.blank()
            reply = self.set_leds(np.zeros((LED_COUNT, 3), np.uint8) if colours is None else colours)
            if colours is not None and reply.scale != protocol.FULL_SCALE:
                raise BoardError(
                    f"the current limit scales this light to {reply.scale / protocol.FULL_SCALE:.1%}, so it is not the "
                    "light that was asked for: dim it, or raise the limit with an external supply"
                )
            self.still = None if colours is None else self.still
            latched = self.wait_for_light(reply.light_id, timeout_s)
            since = itertools.takewhile(lambda event: event is not latched, reversed(self.events))
            if not any(isinstance(event, protocol.DarkEvent) for event in since):
                self._dark, self.lit_s = None, time.monotonic()
            return reply.light_id

    def blank(self) -> None:
        """End a sequence and make the LEDs dark."""
        self.still = None
        self._request("BLANK", protocol.Empty)
        self._dark = None

    def load_sequence(self, groups: Sequence[NDArray[np.uint8]], steps: Sequence[Step], *, loops: int = 0) -> None:
        """Stage groups, each (12, 3) uint8 RGB, and steps, and commit them; `loops` 0: endless."""
        table = [colour_bytes(colours) for colours in groups]
        table += [bytes(COLOUR_BYTES)] * (protocol.GROUP_COUNT - len(table))
        for index, staged in enumerate(table):
            self._request("SET_GROUP", protocol.GroupReply, protocol.SetGroup(index, staged))
        records = [protocol.SetStep(i, s.group, s.repeat, s.dwell_us, s.blank_us) for i, s in enumerate(steps)]
        for record in records:
            self._request("SET_STEP", protocol.Empty, record)
        crc = zlib.crc32(b"".join(table) + b"".join(record.pack() for record in records))
        self._request("COMMIT", protocol.Empty, protocol.Commit(crc, loops, len(records)))

    def set_sync(self, mode: SyncMode, *, edge: Edge = Edge.RISING, divider: int = 1, delay_us: int = 0,
                 timeout_us: int = 0) -> None:  # fmt: skip
        """Choose what moves a sequence on: HOLD (`step`), FREE (the board's clock) or EXT (the trigger pin)."""
        self._request("SET_SYNC", protocol.Empty, protocol.SetSync(mode, edge, divider, delay_us, timeout_us))

    def trim(self, *, phase_us: int = 0, period: float = 0.0) -> None:
        """Shift a FREE sequence once and stretch its durations by a fraction of at most 0.01 either way."""
        self._request("TRIM", protocol.Empty, protocol.Trim(phase_us, round(period * 2**32)))

    def start(self) -> None:
        """Begin the committed sequence."""
        self.still = None
        self._request("START", protocol.Empty)

    def step(self) -> protocol.LightReply:
        """Show the next step of a HOLD sequence."""
        self.still = None
        return self._request("STEP", protocol.LightReply)

    def stop(self) -> None:
        """End the sequence; what is lit stays lit."""
        self._request("STOP", protocol.Empty)

    def set_limits(self, limit_ma: int, policy: Policy) -> None:
        """Limit the current of all LEDs together."""
        self._request("SET_LIMITS", protocol.Empty, protocol.SetLimits(limit_ma, policy))

    def status(self) -> protocol.StatusReply:
        """Return what the board is doing."""
        sent_s = time.monotonic()
        reply = self._request("STATUS", protocol.StatusReply)
        self._tell_ping(sent_s, reply.time_us, reply.time_us)
        return reply

    def counters(self) -> protocol.CountersReply:
        """Return what went wrong since the start of the board."""
        return self._request("COUNTERS", protocol.CountersReply)

    def telemetry(self, period_ms: int) -> None:
        """Let the board report its status by itself, 0: not any more."""
        self._request("TELEMETRY", protocol.Empty, protocol.Telemetry(period_ms))

    def configuration(self) -> protocol.Configuration:
        """Return the configuration in force."""
        return self._request("GET_CONFIG", protocol.Configuration)

    def configure(self, configuration: protocol.Configuration, *, save: bool = False) -> None:
        """Change the configuration; `save` keeps it without power."""
        self._request("SET_CONFIG", protocol.Empty, configuration)
        if save:
            self._request("SAVE_CONFIG", protocol.Empty)

    def factory(self) -> None:
        """Return to the built-in configuration, not yet saved."""
        self._request("FACTORY", protocol.Empty)

    def self_test(self) -> protocol.SelfTestReply:
        """Let the board test itself; its LEDs have to be dark."""
        return self._request("SELFTEST", protocol.SelfTestReply)

    def reset(self) -> None:
        """Start the board anew; the connection is lost."""
        self._request("RESET", protocol.Empty, protocol.Magic(protocol.RESET_MAGIC))

    def enter_bootloader(self) -> None:
        """Start the boot loader of the chip; the connection is lost."""
        self._request("BOOTLOADER", protocol.Empty, protocol.Magic(protocol.BOOTLOADER_MAGIC))

    # ---- events ----

    def wait_for_light(self, light_id: int, timeout_s: float = 1.0) -> protocol.LightEvent:
        """Wait until the LEDs have latched a light; BoardError if they do not."""
        with self._lock:
            silences = 0
            while silences <= max(1, round(timeout_s / self.timeout_s)):
                for event in self.events:
                    if isinstance(event, protocol.LightEvent) and event.light_id == light_id:
                        return event
                silences += not self._receive(self.timeout_s)
        raise BoardError(f"light {light_id} was not latched within {timeout_s} s: see `gellight ring info`")


def chip_temperature_c(hello: protocol.HelloReply, status: protocol.StatusReply) -> float | None:
    """Return the temperature of the board's chip in degrees Celsius, good to some 5 degrees; None without a sensor.

    T = 27 - (V - 0.706) / 0.001721 for the sensor's voltage V, 12 bits of 3.3 V (data sheet of the RP2040, 4.9.5).
    """
    if not hello.capabilities & Capability.TEMPERATURE:
        return None
    return 27 - (status.temperature * 3.3 / 4096 - 0.706) / 0.001721


def colour_bytes(colours: NDArray[np.uint8]) -> bytes:
    """Return (12, 3) uint8 RGB in the order of the wire; ValueError for any other array."""
    array = np.asarray(colours)
    if array.shape != (LED_COUNT, 3) or array.dtype != np.uint8:
        raise ValueError(f"colours have to be ({LED_COUNT}, 3) uint8, not {array.shape} {array.dtype}")
    return array.tobytes()
