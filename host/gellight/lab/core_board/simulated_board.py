"""``sim://``: the compiled core on the clock of this computer, as a stream of bytes and a timeline of light."""

import struct
import threading
import time
import zlib
from math import exp

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError
from gellight.base.leds import MOST_LEDS
from gellight.lab.core_board.core import FLASH_BYTES, RESTARTED, Core, packaged_library
from gellight.lab.core_board.light_timeline import Light, LightTimeline
from gellight.ring.protocol import CURRENT_CAP_EXTERNAL_MA, CURRENT_CAP_MA, Configuration
from gellight.ring.wire import LED_COUNT

COLDEST_C, HOTTEST_C = -40.0, 125.0
"""the NTC of the strip is made for these"""
PAGE_BYTES, MAGIC = 256, 0x474C4346  # a page of flash; MAGIC of firmware/core/config.c
FULL_LED_MA = 21
"""of an LED that shines in one colour, by the board's model"""


def check_buildable(leds: int, ring_c: float | None) -> None:
    """Raise BoardError for what no board has."""
    if not 1 <= leds <= MOST_LEDS:
        raise BoardError(f"{leds} LEDs: a board drives 1 to {MOST_LEDS}")
    if ring_c is not None and not COLDEST_C <= ring_c <= HOTTEST_C:
        raise BoardError(f"a ring of {ring_c:g} °C: its NTC is made for {COLDEST_C:g} to {HOTTEST_C:g} °C")


def thermistor_ohm(temperature_c: float) -> float:
    """Return what the NTC of the strip has: R = 10 kohm * exp(B * (1 / T - 1 / T25)), in kelvin, B = 3380 K."""
    return 10e3 * exp(3380 * (1 / (temperature_c + 273.15) - 1 / 298.15))


def thermistor_reading(temperature_c: float) -> int:
    """Return what the converter reads of 4096 where 10 kohm lead to the NTC from full scale."""
    ohm = thermistor_ohm(temperature_c)
    return int(4096 * ohm / (ohm + 10e3))


def configuration_of(leds: int) -> Configuration:
    """Return that of a simulated board with `leds`; with a supply of their own where USB could not light all."""
    strong = leds * FULL_LED_MA > CURRENT_CAP_MA
    return Configuration(
        host_timeout_ms=1000, limit_ma=CURRENT_CAP_EXTERNAL_MA if strong else CURRENT_CAP_MA, quiescent_ua=1000,
        channel_ua=20000, latch_us=300, unused=0, external_supply=int(strong), name=b"GelLight".ljust(16, b"\0"),
        led_count=leds,
    )  # fmt: skip


def record_of(configuration: Configuration) -> bytes:
    """Return the first record of a configuration, as a board saves it."""
    page = (struct.pack("<II", MAGIC, 1) + configuration.pack()).ljust(PAGE_BYTES - 4, b"\xff")
    return page + struct.pack("<I", zlib.crc32(page))


UNIQUE_ID = bytes.fromhex("e6605838833a5d2f")
HEAT_KNOWN_US = 300_000
"""after which a board surely has measured its ring"""
STROBE_US = 500
"""as long a strobe is high"""
DARK_US = 20_000
"""after which a board whose port was closed is dark"""
SLICE_US = 1_000_000
"""in which the fastest sequence latches fewer lights than the core remembers"""


class SimulatedBoard:
    """A transport to a simulated board, and what its LEDs show; several threads may use it.

    The core is brought to the present whenever somebody looks at it or speaks to it, so it is never late and needs no
    thread. Its time in us began when it was switched on; `virtual_us` converts a time of `time.monotonic`, so that a
    camera can ask what was lit during its exposure.
    """

    url = "sim://"

    def __init__(self, *, leds: int = LED_COUNT, ring_c: float | None = None, unique_id: bytes = UNIQUE_ID,
                 opened: bool = True) -> None:  # fmt: skip
        """Switch a board on; `opened`: with its port open.

        `unique_id` are the 8 bytes from which it makes its serial number; by default those of every simulated board.
        `leds` is the number that it is configured for; `ring_c`: its ring has an NTC of so many degrees Celsius, None:
        it has none. Raises BoardError for what no board has, and where none was built for this machine.
        """
        check_buildable(leds, ring_c)
        record = b"" if leds == LED_COUNT else record_of(configuration_of(leds))
        self._there = True
        self._timeline, self._leds = LightTimeline(leds), leds
        self._lock = threading.Condition()
        self._falls_us: int | None = None
        """when the trigger pin falls after a strobe"""
        self._unique_id = unique_id
        self._past_us = 0
        """virtual time before the core was started last: not 0 where `_restart` starts it anew"""
        self._power_on(record.ljust(FLASH_BYTES, b"\xff"), 0)
        if ring_c is not None:
            self._core.call("warm_ring", thermistor_reading(ring_c))
            self._advance_to(HEAT_KNOWN_US)
        self._zero_s = time.monotonic() - self._now_us * 1e-6
        """when virtual time began"""
        if opened:
            self.link(True)

    @property
    def _now_us(self) -> int:
        return self._past_us + self._core.now_us

    def _power_on(self, flash: bytes, saves: int) -> None:
        self._core, self._seen = Core(packaged_library(), flash, saves=saves), 0
        self._core.call("identify", self._unique_id)

    @property
    def running(self) -> bool:
        """Whether the board is there; False once it is closed, has started anew or has lost its power."""
        with self._lock:
            self._advance()
            return self._there

    # ---- transport ----

    def link(self, opened: bool) -> None:
        """Open or close the port; closed, the LEDs go dark."""
        with self._lock:
            self._advance()
            self._core.link(opened)

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        with self._lock:
            self._advance()
            self._check_there()
            self._core.receive(data)
            self._lock.notify_all()

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, waiting for the first byte for `timeout_s` at most."""
        end_s = time.monotonic() + timeout_s
        with self._lock:
            while True:
                now_s = self._advance()
                if data := self._core.take_output():
                    return data
                self._check_there()
                if now_s >= end_s:
                    return b""
                self._lock.wait(min(end_s - now_s, self.idle_s(now_s)))

    def idle_s(self, now_s: float) -> float:
        """Return for how long after a time of `time.monotonic` nothing happens by itself."""
        return max(self._zero_s + (self._past_us + self._core.next_us) * 1e-6 - now_s, 0.0)

    def close(self) -> None:
        """Close the port, which makes the LEDs dark, and switch off."""
        with self._lock:
            self._advance()
            if self._there:
                self._core.link(False)
                self._advance_to(self._now_us + DARK_US)
            self._end()

    def _end(self) -> None:
        """Be gone, with dark LEDs."""
        if self._there and self._timeline.shining:
            now_us = max(self._now_us, self._timeline[-1].time_us)
            self._timeline.append(Light(now_us, np.zeros((self._leds, 3), np.uint8)))
        self._there = False
        self._lock.notify_all()

    def _restart(self) -> None:
        """Start anew, as the host asked it to: to that host the board is gone. Behind a terminal it comes back."""
        self._end()

    def _check_there(self) -> None:
        if not self._there:
            raise BoardError("the simulated board has ended: open sim:// again")

    # ---- time and light ----

    def _advance(self) -> float:
        """Bring the board to the present, which is returned as a time of `time.monotonic`; one that is gone stays."""
        now_s = time.monotonic()
        if self._there:
            self._advance_to(int((now_s - self._zero_s) * 1e6))
            if self._core.flags & RESTARTED:
                self._restart()
        return now_s

    def _advance_to(self, end_us: int) -> None:
        while (now_us := self._now_us) < end_us:
            falls_us = end_us if self._falls_us is None else self._falls_us
            self._core.advance(min(end_us, falls_us, now_us + SLICE_US) - now_us)
            if self._falls_us is not None and self._now_us >= self._falls_us:
                self._falls_us = None
                self._core.edge(falling=True)
            for light in self._core.latched(self._seen):
                self._timeline.append(Light(self._past_us + light.latched_us, light.rgb(self._leds)))
                self._seen += 1

    @property
    def timeline(self) -> LightTimeline:
        """What the LEDs have latched until now."""
        with self._lock:
            self._advance()
            return self._timeline

    def strobe(self) -> float:
        """Pulse the trigger pin, as a camera's strobe does, and return when (`time.monotonic`) it rose."""
        with self._lock:
            now_s = self._advance()
            self._check_there()
            self._core.edge()
            self._falls_us = self._now_us + STROBE_US
            self._lock.notify_all()
            return now_s

    def virtual_us(self, monotonic_s: float) -> float:
        """Return the board's virtual time at a time of `time.monotonic`."""
        return (monotonic_s - self._zero_s) * 1e6

    def light_at(self, time_us: float) -> NDArray[np.uint8]:
        """Return the (n, 3) colours that were latched at a virtual time, as far as is known now."""
        return self.timeline.at(time_us)

    def light_during(self, start_us: float, end_us: float) -> list[Light]:
        """Return the light at the start of an interval of virtual time and every change in it, once it is over."""
        with self._lock:
            self._lock.wait_for(lambda: not self._there, max(self._zero_s + end_us * 1e-6 - time.monotonic(), 0.0))
            self._advance()
            return self._timeline.interval(start_us, end_us)
