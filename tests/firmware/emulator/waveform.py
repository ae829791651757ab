"""From the level of the LED pin to light: WS2812B bits, their timing, frames and when the LEDs latch them.

Timing windows in ns that hold for WS2812B (V1), WS2812B-V5 and WS2812B-2020 together; a low time of 280 us or more
makes the LEDs latch (data sheet of the V5: "Treset above 280 us"; older ones take 50 us).
"""

from collections.abc import Callable
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gellight.lab.core_board.light_timeline import Light, LightTimeline
from gellight.ring.enumerations import ColourOrder
from gellight.ring.protocol import ACTIVE_LOW, NO_PIN
from gellight.ring.wire import LED_COUNT

LATCH_NS = 280_000.0
WINDOWS_NS = {"T0H": (250.0, 380.0), "T0L": (700.0, 1000.0), "T1H": (650.0, 950.0), "T1L": (580.0, 600.0)}
RISE_NS = 10e6
"""for which the supply of the LEDs may still rise after the load switch has closed"""
ONE_NS = 500.0
"""a longer pulse is a 1"""


class Bit(NamedTuple):
    """One pulse on the wire; the low time of the last bit of a frame is unknown."""

    high_ns: float
    low_ns: float | None


class Strip(NamedTuple):
    """The LEDs that hang at the data pin: what they make of the bits."""

    leds: int = LED_COUNT
    order: ColourOrder = ColourOrder.GRB
    pin: int = 2
    switch: int = NO_PIN
    """of a load switch, plus ACTIVE_LOW where low closes it; a resistor holds it open where the pin is not driven"""

    @property
    def dark(self) -> NDArray[np.uint8]:
        """(n, 3) colours while all is dark."""
        return np.zeros((self.leds, 3), np.uint8)

    @property
    def bits(self) -> int:
        """Number that all LEDs together take."""
        return self.leds * (32 if self.order == ColourOrder.RGBW else 24)

    @property
    def switch_pin(self) -> int | None:
        """The GPIO of the load switch; None: the LEDs always have power."""
        return None if self.switch == NO_PIN else self.switch & ~ACTIVE_LOW

    def powered(self, level: int) -> bool:
        """Whether the load switch is closed while its pin is low (0), high (1) or not driven (another value)."""
        return level == (0 if self.switch & ACTIVE_LOW else 1)

    def colours(self, ones: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """Return (n, 3) RGB; white is no part of it."""
        values = np.packbits(ones).reshape(self.leds, -1)
        return values[:, [0, 1, 2] if self.order == ColourOrder.RGB else [1, 0, 2]]


class WaveformDecoder:
    """Read the pin edge by edge; every bit out of its window and every torn frame is reported."""

    def __init__(self, timeline: LightTimeline, report: Callable[[str], None], strip: Strip) -> None:
        """Fill the timeline, and report what LEDs might misread."""
        self.timeline, self.strip = timeline, strip
        self.bits: list[Bit] = []
        """of the last frame that was latched"""
        self._report = report
        self._frame: list[Bit] = []
        self._powered_ns = 0.0 if strip.switch_pin is None else inf
        """from this time on the LEDs have their full supply"""
        self._rise_ns = self._fall_ns = 0.0
        self._high = False

    def edge(self, time_ns: float, high: bool) -> None:
        if high == self._high:
            return
        self._high = high
        if high:
            self._rise(time_ns)
        else:
            self._fall_ns = time_ns
            self._frame.append(Bit(time_ns - self._rise_ns, None))

    def supply(self, time_ns: float, closed: bool) -> None:
        """Note that the load switch closes or opens; open, the LEDs are dark and forget what they were sent."""
        if closed == (self._powered_ns < inf):
            return
        self.settle(time_ns)
        self._powered_ns = time_ns + RISE_NS if closed else inf
        if not closed and len(self.timeline) and self.timeline[-1].colours.any():
            self.timeline.append(Light(max(time_ns / 1e3, self.timeline[-1].time_us), self.strip.dark))

    def settle(self, now_ns: float) -> None:
        """Let the LEDs latch if the line has been low for long enough."""
        if self._frame and not self._high and now_ns - self._fall_ns >= LATCH_NS:
            self._latch()

    def _rise(self, time_ns: float) -> None:
        self.settle(time_ns)
        if self._frame:
            self._frame[-1] = Bit(self._frame[-1].high_ns, time_ns - self._fall_ns)
            self._check(self._frame[-1])
        self._rise_ns = time_ns

    def _check(self, bit: Bit) -> None:
        name = "T1" if bit.high_ns > ONE_NS else "T0"
        for part, value in (("H", bit.high_ns), ("L", bit.low_ns)):
            low, high = WINDOWS_NS[name + part]
            if value is not None and not low <= value <= high:
                self._report(f"WS2812B: {name}{part} of {value:.0f} ns is not within {low:.0f} to {high:.0f} ns")

    def _latch(self) -> None:
        bits, self._frame = self._frame, []
        self._check(bits[-1])
        if len(bits) != self.strip.bits:
            self._report(f"WS2812B: a frame of {len(bits)} bits, not {self.strip.bits}: torn")
        self.bits = bits
        ones = np.zeros(self.strip.bits, bool)
        ones[: len(bits)] = [bit.high_ns > ONE_NS for bit in bits[: self.strip.bits]]
        if self._fall_ns < self._powered_ns and ones.any():
            self._report("WS2812B: light is sent while the supply of the LEDs is off or rises")
        if self._fall_ns < self._powered_ns:
            return
        self.timeline.append(Light((self._fall_ns + LATCH_NS) / 1e3, self.strip.colours(ones)))
