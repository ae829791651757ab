"""Follows the light of a ring: feeds clock map and known light from what the ring hears, and labels frames by both."""

import itertools
import threading
import time
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError
from gellight.frames.camera import CameraTiming
from gellight.frames.frames import LightLabel, LightState
from gellight.ring import protocol
from gellight.ring.enumerations import Dark
from gellight.ring.heat import hot_text
from gellight.ring.light_ring import LightRing, Ping
from gellight.ring.wire import Record
from gellight.sensor.lighting.clock import ClockMap, Interval
from gellight.sensor.lighting.timeline import UNTOLD, KnownLight, Plan

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
MIXED, UNKNOWN = -10, -11
UNKNOWN_LABEL = LightLabel(state=LightState.UNKNOWN)


class RowExposures(NamedTuple):
    """When the rows of one frame were exposed, board us: (H,) each, bounds of the beginning and of the end."""

    begin_low: Array
    begin_high: Array
    end_low: Array
    end_high: Array


def row_exposures(clock: ClockMap, timing: CameraTiming, time_s: float, rows: int) -> RowExposures:
    """Return the bounds for a frame whose stamp is `time_s`, `time.monotonic`; ValueError where `clock` is not sure."""
    offset_us = clock.offset_us(*timing.span_s(time_s))
    time_s += timing.stamp_delay_s
    begins = (time_s + timing.readout_s * np.arange(rows) / max(rows - 1, 1)) * 1e6
    ends = begins + timing.exposure_s * 1e6
    error_us = timing.stamp_error_s * 1e6
    low_us, high_us = offset_us.low - error_us, offset_us.high + error_us
    return RowExposures(begins + low_us, begins + high_us, ends + low_us, ends + high_us)


def light_of_rows(exposed: RowExposures, light: KnownLight, pulse_period_us: float) -> tuple[Rows, set[int]]:
    """Return for each row the one light that it saw, else MIXED or UNKNOWN, (H,); and every light that some row saw.

    A light was surely seen where it had a whole cycle of the modulation to show.
    """
    sure, until, group = light.between(float(exposed.begin_low[0]), float(exposed.end_high[-1]))
    found = np.full(len(exposed.begin_low), UNKNOWN)
    before = np.full(len(exposed.begin_low), UNTOLD)
    seen: set[int] = set()
    for from_us, to_us, what in zip(sure, until, group, strict=True):
        if what == UNTOLD:
            continue
        saw = np.minimum(exposed.end_low, to_us) - np.maximum(exposed.begin_high, from_us) >= pulse_period_us
        found[saw & (before != UNTOLD) & (before != what)] = MIXED
        before[saw] = what
        seen |= {int(what)} if saw.any() else set()
        found[(exposed.begin_low >= from_us) & (exposed.end_high <= to_us)] = what
    return found, seen


def label_of(rows: Rows, seen: set[int]) -> LightLabel:
    """Sum the rows of a frame up, as told above. Light that is no group of a sequence has no label but unknown."""
    known = set(rows.tolist())
    if MIXED in known or len((known | seen) - {UNKNOWN}) > 1:
        return LightLabel(state=LightState.MIXED)
    (only,) = known if len(known) == 1 else {UNKNOWN}
    return LightLabel(state=LightState.CLEAN, group=int(only)) if only >= 0 else UNKNOWN_LABEL


def label_frame(clock: ClockMap, light: KnownLight, timing: CameraTiming, time_s: float, rows: int) -> LightLabel:
    """Label a frame by its stamp alone; unknown unless pings on both sides of it fit together."""
    from_s, to_s = timing.span_s(time_s)
    if not clock.covers(from_s, to_s):
        return UNKNOWN_LABEL
    exposed = row_exposures(clock, timing, time_s, rows)
    return label_of(*light_of_rows(exposed, light, timing.pulse_period_s * 1e6))


ASKED = 3
"""how often the board is asked about one frame; then it stays unknown"""
FIRST_PINGS = 5
KEPT_EVENTS = 16


class Change(NamedTuple):
    """A light followed another one."""

    old: int
    new: int
    """groups of the board, 255: none"""
    latched_s: Interval
    """when the board had it latched, host time; it shows within one pulse period"""
    light_id: int


class LightWatch:
    """Listens to a ring as long as it is open. Frames can be labelled from about its first ping on."""

    def __init__(self, ring: LightRing, timing: CameraTiming, *, plan: Plan | None = None) -> None:
        """Begin to listen, and ask for the time."""
        self._ring, self.timing = ring, timing
        self._lock = threading.Lock()
        self.clock = ClockMap()
        self.light = KnownLight(pulse_period_us=timing.pulse_period_s * 1e6, plan=plan)
        self._events: deque[protocol.LightEvent] = deque(maxlen=KEPT_EVENTS)
        self._silenced = False
        ring.event_listeners.append(self._note_event)
        ring.ping_listeners.append(self._note_ping)
        try:
            for _ in range(FIRST_PINGS):
                ring.clock()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Listen no more."""
        self._ring.event_listeners.remove(self._note_event)
        self._ring.ping_listeners.remove(self._note_ping)

    # The ring calls these in the thread that talks to the board, and holds its own lock; so ours is never held while
    # the ring is asked something.

    def _note_event(self, event: Record) -> None:
        if isinstance(event, protocol.LightEvent):
            with self._lock:
                self.light.note_event(event)
                self._events.append(event)
        if isinstance(event, protocol.DarkEvent) and event.dark == Dark.HOST_SILENT:
            self._silenced = True

    def silenced(self) -> bool:
        """Whether the board has ended the light, since this was asked last, because it heard nothing from here."""
        silenced, self._silenced = self._silenced, False
        return silenced

    def _note_ping(self, ping: Ping) -> None:
        with self._lock:
            jumps = self.clock.jumps
            self.clock.add(ping)
            if self.clock.jumps != jumps:
                self.light.clear()
                self._events.clear()

    def label(self, time_s: float, rows: int) -> LightLabel:
        """Label a frame by its stamp, after asking which light is on; BoardError if no answer comes or it is dimmed."""
        begin_s, end_s = self.timing.span_s(time_s)
        for attempt in range(ASKED):
            if attempt:
                time.sleep(0.001)
            status = self._ring.status()
            if status.dimmed:
                raise BoardError(hot_text(status))
            with self._lock:
                self.light.note_status(status)
                sure = self.clock.covers(begin_s, end_s)
                if sure and self.light.confirmed_us >= end_s * 1e6 + self.clock.offset_us(begin_s, end_s).high:
                    break
        with self._lock:
            return label_frame(self.clock, self.light, self.timing, time_s, rows)

    def changes(self) -> list[Change]:
        """Return the last changes of the light that were reported, oldest first."""
        with self._lock:
            pairs = itertools.pairwise(self._events)
            return [Change(old.group, new.group, self.clock.host_s(new.latched_us), new.light_id) for old, new in pairs]
