"""Phase lock: move a FREE sequence so that its lights change between two frames of a camera that runs by itself.

The camera's frames are a line through stamps over sequence numbers; the light's changes are told by the board. Both
are in the host's time. The period of the light is k frame periods by the board's clock, and its changes are put where
the slack that k leaves is the same before and after each frame.

A light has to stay for k frames, so that at least one of them is clean. With the settle time s, the readout R, the
exposure E and the frame period P, a frame that begins when the light has settled needs R + E. The light changes just
before a frame begins, so that

    k = ceil((s + R + E) / P)
"""

from collections import deque
from math import ceil
from typing import NamedTuple

import numpy as np

from gellight.frames.camera import CameraTiming
from gellight.ring import protocol
from gellight.ring.wire import LED_COUNT
from gellight.sensor.lighting.clock import Interval

FEWEST_FRAMES = 12  # chosen: stamps of fewer frames tell no period
MOST_FRAMES = 600  # chosen: 20 seconds at 30 frames/s
TOLERANCE = 0.1
"""of the slack; smaller phase errors are left alone"""
FINEST_S = 100e-6
"""so are errors below this: the scatter of stamps"""
WIRE_S = 30e-6
"""an LED: 24 bits of 1.25 us"""
LATCH_S = 0.30e-3
"""low time after which the LEDs take their data, as the board waits for it"""
EXACT = 1e-9
"""share of a frame that is rounding: an exact multiple is not one frame more"""


def settle_s(timing: CameraTiming, clock_error_s: float = 0.0, *, leds: int = LED_COUNT) -> float:
    """Return how long it is uncertain which light a row sees: wire, latch, one pulse, and the clocks on either side.

    `clock_error_s` is how far the host may be off about the board's clock, `timing.stamp_error_s` about the camera's.
    """
    return leds * WIRE_S + LATCH_S + timing.pulse_period_s + 2 * (clock_error_s + timing.stamp_error_s)


def hold_frames(timing: CameraTiming, *, clock_error_s: float = 0.0, leds: int = LED_COUNT) -> int:
    """Return how many frame periods each light has to stay, by the equation above; at least 1."""
    frames = (settle_s(timing, clock_error_s, leds=leds) + timing.readout_s + timing.exposure_s) / timing.period_s
    return max(1, ceil(frames - EXACT))


class Trim(NamedTuple):
    """What to tell the board."""

    phase_us: int
    """to be added once to the begin of the next light"""
    period: float
    """by which all durations are longer, as a fraction"""


class PhaseLock:
    """Learns the camera's frames and says how to trim; the lights stay for `frames` frame periods each."""

    def __init__(self, timing: CameraTiming, *, frames: int, leds: int = LED_COUNT) -> None:
        """Begin without knowledge."""
        self._timing, self._frames, self._leds = timing, frames, leds
        self.dwell_us = 0
        """how long the sequence shows each light, by the board's clock"""
        self._stamps: deque[tuple[int, float]] = deque(maxlen=MOST_FRAMES)
        self._trimmed_at = -FEWEST_FRAMES

    def note_frame(self, sequence: int, time_s: float) -> None:
        """Take in the stamp of a frame."""
        if not self._stamps or sequence > self._stamps[-1][0]:
            self._stamps.append((sequence, time_s))

    @property
    def ready(self) -> bool:
        """Whether there are frames enough."""
        return len(self._stamps) >= FEWEST_FRAMES

    def line(self) -> tuple[float, float]:
        """Return when the newest frame began and the frame period, s, from all stamps; ValueError for too few."""
        if not self.ready:
            raise ValueError(f"{len(self._stamps)} frames do not tell the frame period: {FEWEST_FRAMES} are needed")
        sequence, stamp = np.array(self._stamps).T
        period, begin = np.polyfit(sequence - sequence[-1], stamp - stamp[-1], 1)
        return float(begin + stamp[-1]), float(period)

    def trim(self, latched_s: Interval, drift: Interval) -> Trim | None:
        """Return what to tell the board, given when the last light was latched; None where nothing is to be done.

        After a trim it takes a light and some frames until another one can make sense.
        """
        newest = self._stamps[-1][0] if self._stamps else 0
        if not self.ready or newest - self._trimmed_at < 2 * self._frames + 2:
            return None
        begin_s, period_s = self.line()
        taken_s = settle_s(self._timing, latched_s.error, leds=self._leds) + self._timing.duration_s
        slack_s = max(self._frames * period_s - taken_s, 0.0)  # how much longer a light stays than one frame takes
        shows_s = latched_s.middle + latched_s.error + self._timing.pulse_period_s + self._timing.stamp_error_s
        wanted_s = begin_s + self._timing.stamp_delay_s - slack_s / 2
        phase_error_s = (wanted_s - shows_s + period_s / 2) % period_s - period_s / 2
        if abs(phase_error_s) < max(TOLERANCE * slack_s, FINEST_S):
            return None
        self._trimmed_at = newest
        # Earlier than planned is not possible for a light that is already on its way.
        forward_s = phase_error_s if phase_error_s > -0.001 else phase_error_s + period_s
        stretched = self._frames * period_s * 1e6 * (1 + drift.middle) / self.dwell_us - 1
        most = protocol.TRIM_MAX / 2**32
        return Trim(round(forward_s * 1e6), float(np.clip(stretched, -most, most)))
