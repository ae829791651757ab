"""Follows the light of a ring: feeds clock map and known light from what the ring hears, and labels frames by both."""

import itertools
import threading
import time
from typing import NamedTuple

from gellight.base.errors import BoardError
from gellight.frames.camera import CameraTiming
from gellight.frames.frames import LightLabel
from gellight.ring import protocol
from gellight.ring.enumerations import Dark
from gellight.ring.heat import hot_text
from gellight.ring.light_ring import LightRing, Ping
from gellight.ring.wire import Record
from gellight.sensor.lighting.clock import ClockMap, Interval
from gellight.sensor.lighting.label import label_frame
from gellight.sensor.lighting.timeline import KnownLight, Plan

ASKED = 3
"""how often the board is asked about one frame; then it stays unknown"""
FIRST_PINGS = 5  # chosen: bounds of the board's clock before the first frame


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
            pairs = itertools.pairwise(self.light.events)
            return [Change(old.group, new.group, self.clock.host_s(new.latched_us), new.light_id) for old, new in pairs]
