"""What the host knows of the light: from the board's LIGHT events, and from asking which light is on now.

Times are the board's, in us. A light begins to show somewhere between its first bit on the wire and one cycle of the
LEDs' modulation after it was latched. It is known to be the only one until the next light's first bit, or until the
board was last asked. Where a light's number is missing, an event got lost: then nothing is known in between.
"""

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gellight.ring import protocol

Array = NDArray[np.float64]
OTHER, UNTOLD = -1, -2
"""a light that is no group of a sequence, or darkness; a light of which no event came"""
REPORT_US = 2500.0
"""the board reports a light within this time of its first bit, even if it has to send it twice"""
REPEAT_US = 2000.0
"""a transfer that was disturbed is sent again within this time and only then reported; in between the LEDs may show
anything"""
SLACK_US = 100.0
"""a light that begins later than planned by more than this may be the repetition of a disturbed one"""
KEPT_EVENTS = 16  # chosen: lights that can still be asked for
FEWEST_ON_GRID, MOST_ON_GRID = 4, 8
"""the plan goes by the earliest of this many lights, for a single light may itself have been late"""
KEPT = 64  # chosen: two seconds of a light a frame at 30 frames/s

Plan = Callable[[protocol.LightEvent, protocol.LightEvent], float | None]
"""how long after the first light the second was to begin, board us; None where it was not planned"""


class KnownLight:
    """The lights that were reported, in order, and until when the last one is known to be on."""

    def __init__(self, *, pulse_period_us: float, plan: Plan | None = None) -> None:
        """Know nothing; `plan` lets a light that came on time count from its first bit, not earlier.

        Without it lights come when somebody asks for them.
        """
        self._pulse_us, self.plan = pulse_period_us, plan
        self.lost = 0
        """stretches of which no event came"""
        self.clear()

    def clear(self) -> None:
        """Forget everything: the board has started anew, or other groups were loaded."""
        self._lights: deque[tuple[float, float, int]] = deque(maxlen=KEPT)
        self.events: deque[protocol.LightEvent] = deque(maxlen=KEPT_EVENTS)
        """the last lights as they were reported, each once"""
        self._grid: deque[float] = deque(maxlen=MOST_ON_GRID)
        """when the last light was to begin, by each of the last ones"""
        self.confirmed_us = -np.inf
        """the board's time until which the light is known"""

    @property
    def _newest(self) -> protocol.LightEvent | None:
        return self.events[-1] if self.events else None

    def note_event(self, event: protocol.LightEvent) -> None:
        """Take in a LIGHT event, in the order of the board."""
        last = self._newest
        if last is not None and event.light_id == last.light_id:
            self.events[-1] = event
            return
        self.events.append(event)
        if last is None or event.light_id != last.light_id + 1:
            self._lose()
            last = None
        begin_us = self._begin_us(last, event)
        group = OTHER if event.group == protocol.NO_STEP else event.group
        again = self._lights and self._lights[-1][2] == group >= 0 and begin_us == event.first_bit_us
        if not again:  # a light that is sent again, and not disturbed, changes nothing
            self._lights.append((begin_us, event.latched_us + self._pulse_us, group))
        self.confirmed_us = max(self.confirmed_us, float(event.latched_us))

    def _begin_us(self, last: protocol.LightEvent | None, event: protocol.LightEvent) -> float:
        """From when on the light may show, or what a disturbed transfer before it left."""
        after_us = self.plan(last, event) if self.plan and last else None
        self._grid = deque((due_us + after_us for due_us in self._grid) if after_us else (), MOST_ON_GRID)
        planned_us = min(self._grid, default=0.0)
        planned = len(self._grid) >= FEWEST_ON_GRID
        self._grid.append(float(event.first_bit_us))
        if planned and event.first_bit_us <= planned_us + SLACK_US:
            return float(event.first_bit_us)
        return min(planned_us, event.first_bit_us - REPEAT_US) if planned else event.first_bit_us - REPEAT_US

    def note_status(self, status: protocol.StatusReply) -> None:
        """Take in which light the board says is on; every event before this answer has to have been noted.

        An answer that is older than the last event tells nothing: both may come in one transfer.
        """
        newest = self._newest
        if newest is not None and status.time_us < newest.latched_us:
            return
        if newest is None or status.light_id != newest.light_id:
            self._lose()
        else:
            self.confirmed_us = max(self.confirmed_us, status.time_us - REPORT_US)

    def _lose(self) -> None:
        if self._lights and self._lights[-1][2] != UNTOLD:
            self.lost += 1
            self._lights.append((self.confirmed_us, np.inf, UNTOLD))

    def between(self, from_us: float, to_us: float) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return the lights that may have been on from one time to another.

        Three arrays (n,): from when on each surely shows, until when it surely does (the last one: as far as is
        known), and its group: 0 and up, OTHER or UNTOLD. Nothing known: n is 0.
        """
        if not self._lights:
            return np.empty(0), np.empty(0), np.empty(0, np.int64)
        begin, sure, group = (np.array(column) for column in zip(*self._lights, strict=True))
        until = np.append(begin[1:], self.confirmed_us if group[-1] != UNTOLD else begin[-1])
        ends = np.append(begin[1:], np.inf)
        chosen = (ends >= from_us) & (begin <= to_us)
        return sure[chosen], until[chosen], group[chosen].astype(np.int64)
