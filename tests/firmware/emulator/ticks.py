"""What the RP2040 counts time by: the tick that the watchdog makes of clk_ref, and the timer (data sheet 4.6, 4.7.2).

The emulator's own timer counts microseconds whatever the clocks are; here a wrong divider or source spoils all times.
"""

from collections.abc import Callable
from math import inf
from typing import Any

from rp2040py.peripherals.timer import ALARM0, ALARM_REGS, RPTimer

from tests.firmware.emulator.registers import Guard, aliased

LOAD, LONGEST = 0x04, 0xFFFFFF
TICK, ENABLED, RUNNING, CYCLES = 0x2C, 1 << 9, 1 << 10, 0x1FF
"""of the watchdog"""
COUNTS_A_TICK = 2
"""by which the watchdog falls (erratum RP2040-E1)"""
STOPPED_HZ = 1e-6
"""the emulator's watchdog cannot count with 0 Hz"""


class Timer(RPTimer):
    """The timer, which counts ticks; without them it stands still."""

    def __init__(self, chip: Any) -> None:
        super().__init__(chip, "TIMER_BASE")
        self._tick_ns, self._counted = inf, 0.0

    def reset(self) -> None:
        """Begin at 0, with no alarm."""
        super().reset()
        self._counted = 0.0

    def set_tick(self, tick_ns: float) -> None:
        """Count on with ticks of this length; inf: none comes."""
        self._counted, self._epoch_nanos, self._tick_ns = self._micros(), self.clock.nanos, tick_ns
        for alarm in self.alarms:
            if alarm.armed:
                self._schedule(alarm)

    def _micros(self) -> float:
        return self._counted + (self.clock.nanos - self._epoch_nanos) / self._tick_ns

    def write_uint32(self, offset: int, value: int) -> None:
        """Set a register; an alarm waits for as many ticks as are left."""
        super().write_uint32(offset, value)
        if offset in ALARM_REGS:
            self._schedule(self.alarms[(offset - ALARM0) // 4])

    def _schedule(self, alarm: Any) -> None:
        alarm.clock_alarm.cancel()
        if self._tick_ns < inf:
            left = int(alarm.target_micros - self._micros()) & 0xFFFFFFFF
            alarm.clock_alarm.schedule(left * self._tick_ns)


class Ticks(Guard):
    """The watchdog with its tick generator, from which timer and watchdog get their ticks."""

    def __init__(self, inner: Any, timer: Timer, reference_hz: Callable[[], float]) -> None:
        """Divide `reference_hz`, that of clk_ref, by nothing yet: so no tick comes (reset value of TICK)."""
        super().__init__(inner, lambda: False, lambda _text: None)
        self._timer, self._reference_hz = timer, reference_hz
        self._control, self._hz = ENABLED, 0.0
        inner.timer.frequency = STOPPED_HZ

    def look(self) -> None:
        """Count at another speed where clk_ref or the divider has changed."""
        cycles = self._control & CYCLES if self._control & ENABLED else 0
        tick_hz = self._reference_hz() / cycles if cycles else 0.0
        if tick_hz == self._hz:
            return
        self._hz = tick_hz
        self._timer.set_tick(1e9 / tick_hz if tick_hz else inf)
        self.inner.timer.frequency = COUNTS_A_TICK * tick_hz or STOPPED_HZ

    def read_uint32(self, offset: int) -> int:
        """Read through, but for TICK."""
        if offset == TICK:
            return self._control | RUNNING * (self._hz > 0)
        return super().read_uint32(offset)

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        """Write through; TICK sets the divider."""
        super().write_uint32_atomic(offset, value, alias)
        if offset == LOAD and not value & LONGEST and self.inner.timer.enable:
            self.inner.alarm.callback()  # it has reached zero (4.7.1)
        if offset == TICK:
            self._control = aliased(self._control, value, alias) & (ENABLED | CYCLES)
            self.look()
