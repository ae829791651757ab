"""The light ring: typed commands, and what keeps its light on; the LEDs are dark when nobody holds it open.

with connect("sim://") as ring:
    ring.set_leds(np.full((12, 3), 40, np.uint8))
"""

import itertools
import logging
import threading
import time
import zlib
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError
from gellight.ring import protocol
from gellight.ring.board_link import BoardLink
from gellight.ring.enumerations import Dark, Edge, State, SyncMode
from gellight.ring.heat import HeardHeat, hot_text
from gellight.ring.transport import Transport, open_transport
from gellight.ring.wire import Record

logger = logging.getLogger(__name__)

SILENCE_S = 0.5
"""a board that was heard of within this time has not made its LEDs dark for silence: it waits 1 s for the host"""
BY_ITSELF = {Dark.BOOT, Dark.HOST_SILENT, Dark.PORT_CLOSED, Dark.SUSPENDED, Dark.FAULT}
"""why a board ends a light or a sequence that nobody has told it to end"""
LOST_S = 0.5
"""after so long the board is asked for a light of which no event came: one may have been lost"""
LATCH_TIMEOUT_S = 5.0
"""a board latches a light within milliseconds; an emulated one on a busy machine takes longer"""


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


class LightRing(BoardLink, AbstractContextManager["LightRing"]):
    """A board that has said hello. Close it, or use it in a `with` statement: then its LEDs are dark."""

    def __init__(self, transport: Transport, *, timeout_s: float = 0.25, attempts: int = 4,
                 keep_alive_s: float | None = 0.25) -> None:  # fmt: skip
        """Say hello; `keep_alive_s` None: the caller sends something every second, or the LEDs go dark."""
        self.ping_listeners: list[Callable[[Ping], None]] = []
        """called with the clocks after every `clock` and `status`, in the thread that asked"""
        self.still: NDArray[np.uint8] | None = None
        """(n, 3) colours of the last `set_leds`; None before it and after a sequence, a step or `blank`"""
        self.lit_s = -inf
        """`time.monotonic` when `light` last knew that its light is on; inf: the board has made that light dark"""
        self.dimmed = 0
        """how often the board halves every colour because it is hot, as it said last"""
        self.heat = HeardHeat()
        """the thread that keeps the light on asks for it now and then"""
        self._dark: Dark | None = None
        """why the board has made its LEDs dark by itself; None: it has not, or they are lit again"""
        self._running = False
        """whether a sequence was started that nothing has ended since, as far as is known"""
        self._heard_s = -inf
        """`time.monotonic` of the last answer"""
        self._disturbances = 0
        """retries and damaged packets up to which the light is known"""
        self._doubted = False
        """whether an event of the board may have been lost, so that its light is not known"""
        self._lighting = threading.RLock()
        """held while a light is on its way, so that no other replaces it; taken before the lock of the requests"""
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        super().__init__(transport, timeout_s=timeout_s, attempts=attempts)
        if keep_alive_s is not None:
            self._thread = threading.Thread(target=self._keep_alive, args=(keep_alive_s,), daemon=True)
            self._thread.start()

    # ---- life ----

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
                self.status() if self.heat.due() else self.clock()
                self._settle_doubts()
                self._light_again()
                silent = False
            except BoardError as error:
                if not silent:
                    logger.warning("the board of the light ring does not answer: %s", error)
                silent = True
            except Exception:  # of who listens to the board: the light must not go out because of that
                logger.exception("a fault of GelLight itself: please report it")

    def _light_again(self) -> None:
        """Show the last still light once more where the board has made it dark by itself."""
        if self._dark is None or not self._lighting.acquire(blocking=False):
            return  # it is lit, or a program is just lighting it
        try:
            why = (self._dark or Dark.NOT_DARK).name.replace("_", " ").lower()
            what = "is cool again" if self._dark is Dark.NOT_DARK else f"made its LEDs dark ({why})"
            if self.still is None:
                self._dark = None
                runs = "its sequence goes on with the next light" if self._running else "a sequence that ran has ended"
                logger.warning("the board %s; %s", what, runs)
            else:
                self.light(self.still)
                logger.warning("the board %s; they are lit again", what)
        finally:
            self._lighting.release()

    def lit_since_s(self) -> float:
        """Return from when on (`time.monotonic`) the light of the last `light` surely was on until now.

        A board that was not heard of for `SILENCE_S`, or whose packets were damaged, is asked first, since it may have
        made its LEDs dark. Then, and until they are lit again, this is inf. Raises BoardError where the board does not
        answer.
        """
        if time.monotonic() - self._heard_s > SILENCE_S:
            self.clock()
        self._settle_doubts()
        return inf if self._doubted else self.lit_s

    def _settle_doubts(self) -> None:
        """Ask the board for its light where the event that would have told of another one may have been lost."""
        self._doubted = self._doubted or self.retries + self.damaged != self._disturbances
        if not self._doubted or not self._lighting.acquire(blocking=False):
            return  # all is known, or a program is just lighting it
        try:
            status = self.status()
            with self._lock:
                self._doubted, self._disturbances = False, self.retries + self.damaged
                self._take_status(status)
        finally:
            self._lighting.release()

    def _take_status(self, status: protocol.StatusReply) -> None:
        """Take the events that were lost from the status; the lock of the requests is held."""
        lit = self.still is not None or self._running
        if lit and self._dark is None and status.state == State.STILL and status.dark in BY_ITSELF:
            self._take_event(protocol.DarkEvent(status.time_us, status.events_dropped, status.dark))
        if status.dimmed != self.dimmed:
            self._take_event(protocol.DimmedEvent(status.time_us, status.temperature, status.events_dropped,
                                                  status.dimmed, status.mean_ma, status.ring_temperature))  # fmt: skip

    def _take_event(self, event: Record) -> None:
        if isinstance(event, protocol.DarkEvent):
            # A newer firmware may have reasons that this host does not know.
            self._dark = Dark(event.dark) if event.dark in set(Dark) else Dark.FAULT
            self.lit_s = inf if self.still is not None else self.lit_s
            self._running = self._running and self._dark is Dark.TRIGGER_MISSED
        if isinstance(event, protocol.DimmedEvent):
            self._note_dimmed(event)
        super()._take_event(event)

    def _note_dimmed(self, event: protocol.DimmedEvent) -> None:
        """Frames show another light than was asked for until the board is cool and `light` has shown it again."""
        self.dimmed = event.dimmed
        self.heat.note(event)
        if self.still is not None:
            self.lit_s = inf
            self._dark = self._dark if event.dimmed or self._dark else Dark.NOT_DARK
        if event.dimmed:
            logger.warning(hot_text(event))

    # ---- commands ----

    @property
    def led_count(self) -> int:
        """Return how many LEDs the board drives, which is the number of colours of a light."""
        return self.hello.led_count

    def clock(self) -> protocol.ClockReply:
        """Return the times of the board's clock (us) around this request."""
        sent_s = time.monotonic()
        reply = self._request("CLOCK", protocol.ClockReply, protocol.ClockRequest(0))
        self._tell_ping(sent_s, reply.received_us, reply.sent_us)
        return reply

    def _tell_ping(self, host_sent_s: float, board_received_us: int, board_sent_us: int) -> None:
        ping = Ping(host_sent_s=host_sent_s, board_received_us=board_received_us, board_sent_us=board_sent_us,
                    host_received_s=time.monotonic())  # fmt: skip
        self._doubted = self._doubted or ping.host_received_s - self._heard_s > SILENCE_S
        self._heard_s = ping.host_received_s
        for listener in tuple(self.ping_listeners):
            listener(ping)

    def set_leds(self, colours: NDArray[np.uint8]) -> protocol.LightReply:
        """Light the LEDs: colours (n, 3) uint8 RGB; the reply tells current and scale."""
        with self._lighting:
            record = protocol.SetLeds(colour_bytes(colours, self.led_count))
            reply = self._request("SET_LEDS", protocol.LightReply, record)
            self.still, self._running = np.array(colours), False
            return reply

    def light(self, colours: NDArray[np.uint8] | None, timeout_s: float = LATCH_TIMEOUT_S) -> int:
        """Show a still light, (n, 3) uint8 RGB, and wait until the LEDs have latched it; return its number.

        None ends a sequence and makes the LEDs dark. Raises BoardError where the board refuses the light, is too hot
        for it, or does not latch it.
        """
        with self._lighting:
            if colours is None:
                self.blank()
            else:
                self._check_count(colours)
            reply = self.set_leds(np.zeros((self.led_count, 3), np.uint8) if colours is None else colours)
            if colours is not None and reply.scale != protocol.FULL_SCALE:
                raise BoardError(hot_text(self.status()))
            self.still = None if colours is None else self.still
            shown = self._await_light(reply.light_id, timeout_s)
            with self._lock:
                since = itertools.takewhile(lambda event: event is not shown, reversed(self.events))
                if not any(isinstance(event, protocol.DarkEvent | protocol.DimmedEvent) for event in since):
                    self._dark, self.lit_s = None, time.monotonic()
            return reply.light_id

    def _await_light(self, light_id: int, timeout_s: float) -> Record | None:
        """Wait until the LEDs have latched a still light; return the last event that came before it was known to be on.

        Raises BoardError where they do not latch it.
        """
        end_s = time.monotonic() + timeout_s
        while (left_s := end_s - time.monotonic()) > 0:
            try:
                return self.wait_for_light(light_id, min(LOST_S, left_s))
            except BoardError:
                newest, status = next(reversed(self.events), None), self.status()
            if status.light_id == light_id and shows_still(status):
                return newest
        raise _not_latched(light_id, timeout_s)

    def _check_count(self, colours: NDArray[np.uint8]) -> None:
        if len(colours) != self.led_count:
            raise BoardError(
                f"the board drives {self.led_count} LEDs, this light has {len(colours)}: calibrate with this ring, "
                "or give the board its number of LEDs with `gellight ring configure --leds`"
            )

    def blank(self) -> None:
        """End a sequence and make the LEDs dark."""
        with self._lighting:
            self.still, self._running = None, False
            self._request("BLANK", protocol.Empty)
            self._dark = None

    def load_sequence(self, groups: Sequence[NDArray[np.uint8]], steps: Sequence[Step], *, loops: int = 0) -> None:
        """Stage groups, each (n, 3) uint8 RGB, and steps, and commit them; `loops` 0: endless.

        BoardError for groups of another number of LEDs than the board has, or where it refuses them.
        """
        for colours in groups:
            self._check_count(colours)
        table = [colour_bytes(colours, self.led_count) for colours in groups]
        table += [bytes(3 * self.led_count)] * (protocol.GROUP_COUNT - len(table))
        for index, staged in enumerate(table):
            self._request("SET_GROUP", protocol.GroupReply, protocol.SetGroup(index, staged))
        records = [protocol.SetStep(i, s.group, s.repeat, s.dwell_us, s.blank_us) for i, s in enumerate(steps)]
        for record in records:
            self._request("SET_STEP", protocol.Empty, record)
        crc = zlib.crc32(b"".join(table) + b"".join(record.pack() for record in records))
        self._request("COMMIT", protocol.Empty, protocol.Commit(crc, loops, len(records)))

    def set_sync(self, mode: SyncMode, *, edge: Edge = Edge.RISING, divider: int = 1, delay_us: int = 0,
                 timeout_us: int = 0) -> None:  # fmt: skip
        """Choose what moves a sequence on: FREE (the board's clock) or EXT (the trigger pin)."""
        self._request("SET_SYNC", protocol.Empty, protocol.SetSync(mode, edge, divider, delay_us, timeout_us))

    def trim(self, *, phase_us: int = 0, period: float = 0.0) -> None:
        """Shift a FREE sequence once and stretch its durations by a fraction of at most 0.01 either way."""
        self._request("TRIM", protocol.Empty, protocol.Trim(phase_us, round(period * 2**32)))

    def start(self) -> None:
        """Begin the committed sequence."""
        with self._lighting:
            self.still = self._dark = None
            self._request("START", protocol.Empty)
            self._running = True
            self._forget_dark()

    def _forget_dark(self) -> None:
        """Count a still light that the board had made dark as ended: nobody will light it again."""
        self.lit_s = time.monotonic() if self.lit_s == inf else self.lit_s

    def stop(self) -> None:
        """End the sequence; what is lit stays lit."""
        self._request("STOP", protocol.Empty)
        self._running = False

    def status(self) -> protocol.StatusReply:
        """Return what the board is doing."""
        sent_s = time.monotonic()
        reply = self._request("STATUS", protocol.StatusReply)
        self.heat.note(reply)
        self._tell_ping(sent_s, reply.time_us, reply.time_us)
        return reply

    def counters(self) -> protocol.CountersReply:
        """Return what went wrong since the start of the board."""
        return self._request("COUNTERS", protocol.CountersReply)

    def configuration(self) -> protocol.Configuration:
        """Return the configuration in force."""
        return self._request("GET_CONFIG", protocol.Configuration)

    def configure(self, configuration: protocol.Configuration, *, save: bool = False) -> None:
        """Change the configuration; `save` keeps it without power."""
        self._request("SET_CONFIG", protocol.Empty, configuration)
        if save:
            self._request("SAVE_CONFIG", protocol.Empty)

    def set_supply(self, *, external: bool, channel_ua: int) -> None:
        """Say what feeds the LEDs, and what one colour of one LED draws at least; counts once saved and started anew.

        Too little here, and the board lets the LEDs draw more than their supply and their housing stand.
        """
        record = protocol.SetSupply(protocol.SUPPLY_MAGIC, channel_ua, external)
        self._request("SET_SUPPLY", protocol.Empty, record)

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
        """Wait until the LEDs have latched a light, and let other threads ask the board; BoardError if they do not."""

        def latched(event: Record) -> bool:
            return isinstance(event, protocol.LightEvent) and event.light_id == light_id

        event = self._wait_for_event(latched, timeout_s)
        if isinstance(event, protocol.LightEvent):
            return event
        raise _not_latched(light_id, timeout_s)


def _not_latched(light_id: int, timeout_s: float) -> BoardError:
    return BoardError(f"light {light_id} was not latched within {timeout_s} s: see `gellight ring info`")


def shows_still(status: protocol.StatusReply) -> bool:
    """Whether a board shows the still light that it latched last, and has not made it dark or dimmed it by itself."""
    return status.state == State.STILL and status.dark in (Dark.NOT_DARK, Dark.COMMAND) and not status.dimmed


def colour_bytes(colours: NDArray[np.uint8], led_count: int) -> bytes:
    """Return (n, 3) uint8 RGB in the order of the wire; ValueError for an array of another number of LEDs or kind."""
    array = np.asarray(colours)
    if array.shape != (led_count, 3) or array.dtype != np.uint8:
        raise ValueError(f"colours have to be ({led_count}, 3) uint8, not {array.shape} {array.dtype}")
    return array.tobytes()
