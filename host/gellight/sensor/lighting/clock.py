"""The clock of the board against the clock of the host, as bounds that hold and not as a best guess.

A ping tells four times: the host sent at t0, the board received at b1 and answered at b2, the host got that at t1.
Whatever the two ways took, the offset (board minus host) then lay between b2 - t1 and b1 - t0. No symmetry is assumed:
pings with short round trips simply have narrow bounds. Between pings the offset moves with the drift of the two
crystals, which the pings bound as well; so the bounds of a time grow with its distance from the pings.

The clock of a board that was started anew, or whose computer stood still, jumps. Pings that contradict each other show
that; from then on only the pings right before and after a moment are believed about it, each for itself.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from gellight.ring.light_ring import Ping

MOST_DRIFT = 200e-6
"""of two crystals against each other, with the host's clock being slewed by NTP"""
WANDER = 2e-6
"""drift changes with temperature by no more than this within the window"""
WINDOW_S = 30.0  # chosen: long enough to tell drift, short enough for WANDER
BUCKET_S = 0.5
"""of the pings in each such stretch of time the one with the shortest round trip is kept"""
JUMP_US = 5000.0
"""a ping that misses the bounds by more means that the board has started anew, or stood still for long"""
SURE_US = 5000.0
"""a ping whose bounds are wider would not show if the clock had jumped"""
KEPT_SURE = 48  # chosen: frames that are labelled later still have pings around them
TICK_US = 1.0
"""the board's times are whole"""


class Interval(NamedTuple):
    """A value is somewhere from low to high."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """The value in the middle."""
        return (self.low + self.high) / 2

    @property
    def error(self) -> float:
        """How far the middle may be off."""
        return (self.high - self.low) / 2


class _Bounds(NamedTuple):
    """What one ping tells of the offset."""

    time_us: float
    low_us: float
    high_us: float
    sent_s: float
    received_s: float


def _bounds(ping: Ping) -> _Bounds:
    sent_us, received_us = ping.host_sent_s * 1e6, ping.host_received_s * 1e6
    slip_us = MOST_DRIFT * (received_us - sent_us) + TICK_US
    low_us, high_us = ping.board_sent_us - received_us - slip_us, ping.board_received_us - sent_us + slip_us
    return _Bounds((sent_us + received_us) / 2, low_us, high_us, ping.host_sent_s, ping.host_received_s)


class ClockMap:
    """Converts times of the board (us) to those of the host (s, `time.monotonic`), each with its uncertainty."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self.jumps = 0
        """how often the board's clock was found elsewhere than it had to be"""
        self.irregular = False
        """pings have contradicted each other: this is no crystal"""
        self._clear()

    def _clear(self) -> None:
        self._pings: deque[_Bounds] = deque()
        self._newest: _Bounds | None = None
        self.drift = Interval(-MOST_DRIFT, MOST_DRIFT)
        """how much faster the board's clock runs than the host's, as a fraction"""
        self._sure: deque[_Bounds] = deque(maxlen=KEPT_SURE)
        self.noise_us = 0.0
        """by how much the pings contradict each other: 0 for real clocks; an emulated one runs by fits and starts"""

    def covers(self, from_s: float, to_s: float) -> bool:
        """Whether sure pings on both sides of a stretch of host time fit together: the clock did not jump in it."""
        return bool(self._sure) and self._sure[0].received_s <= from_s and to_s <= self._sure[-1].sent_s

    def add(self, ping: Ping) -> None:
        """Take in a ping, in the order of time."""
        new = _bounds(ping)
        if self._newest is not None:
            low_us, high_us = self._offset(new.time_us)
            if max(new.low_us - high_us, low_us - new.high_us) > JUMP_US:
                self.jumps += 1
                self._clear()
        if new.high_us - new.low_us <= SURE_US:
            self._sure.append(new)
        self._keep(new)
        self._fit()
        self.irregular |= self.jumps > 0 or self.noise_us > 0

    def _keep(self, new: _Bounds) -> None:
        pings, self._newest = self._pings, new
        while len(pings) > 1 and pings[1].sent_s < new.sent_s - WINDOW_S:
            pings.popleft()
        last = pings[-1] if len(pings) > 1 else None  # the first one stays: it tells since when the map holds
        if last and int(last.sent_s / BUCKET_S) == int(new.sent_s / BUCKET_S):
            if new.high_us - new.low_us > last.high_us - last.low_us:
                return
            pings.pop()
        pings.append(new)

    def _fit(self) -> None:
        """Widen the bounds until no two pings contradict each other, then bound the drift by every pair of them."""
        kept = {id(ping): ping for ping in (*self._pings, self._newest) if ping}.values()
        times, low, high = np.array([(p.time_us, p.low_us, p.high_us) for p in kept]).T
        apart = times[:, None] - times
        self.noise_us = max(0.0, float((low[:, None] - high - MOST_DRIFT * np.abs(apart)).max()))
        low, high = low - self.noise_us, high + self.noise_us
        later = apart > 0
        slowest = ((low[:, None] - high)[later] / apart[later]).max(initial=-MOST_DRIFT)
        fastest = ((high[:, None] - low)[later] / apart[later]).min(initial=MOST_DRIFT)
        if slowest > fastest:  # the drift has changed more than pings of this quality allow for
            slowest, fastest = -MOST_DRIFT, MOST_DRIFT
        self._times, self._low, self._high = times, low, high
        self.drift = Interval(float(slowest) - WANDER, float(fastest) + WANDER)

    def _offset(self, time_us: float) -> tuple[float, float]:
        """Bounds of board minus host at a time of the host, us."""
        reach = time_us - self._times
        slow, fast = reach * self.drift.low, reach * self.drift.high
        low = float((self._low + np.minimum(slow, fast)).max())
        high = float((self._high + np.maximum(slow, fast)).min())
        return min(low, high), max(low, high)

    def host_s(self, board_us: float) -> Interval:
        """Return the host's time at a time of the board; ValueError before the first ping."""
        if self._newest is None:
            raise ValueError("the clock of the board is unknown before the first ping: call ring.clock()")
        low, high = self._offset(board_us - (self._newest.low_us + self._newest.high_us) / 2)
        return Interval((board_us - high) * 1e-6, (board_us - low) * 1e-6)

    def offset_us(self, from_s: float, to_s: float) -> Interval:
        """Return what board minus host was all through a stretch of host time that `covers`; else ValueError."""
        if not self.covers(from_s, to_s):
            raise ValueError(f"no pings before {from_s} s and after {to_s} s fit together: call ring.clock() again")
        if not self.irregular:
            first, last = self._offset(from_s * 1e6), self._offset(to_s * 1e6)
            return Interval(min(first[0], last[0]), max(first[1], last[1]))
        begin = max(number for number, ping in enumerate(self._sure) if ping.received_s <= from_s)
        end = min(number for number, ping in enumerate(self._sure) if ping.sent_s >= to_s)
        around = list(self._sure)[begin : end + 1]
        return Interval(min(ping.low_us for ping in around), max(ping.high_us for ping in around))
