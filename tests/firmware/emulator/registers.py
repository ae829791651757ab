"""Register blocks in front of the emulator's: what it does not model, and accesses that real silicon would ignore."""

from collections.abc import Callable
from typing import Any

from tests.firmware.emulator.busy_bus import DIRECT, MUXING, OVERRIDE, BusyBus

FRAME_NS = 1e6
SOF = 1 << 17
"""start of frame in INTR, INTE and INTS of the USB controller"""
SOFTWARE_CONNECT, DATA_LINES = 1 << 3, 1 << 2 | 1 << 0
"""USB_MUXING: the lines are connected, to the pads or to the PHY"""
VBUS_FORCED = 1 << 3 | 1 << 2
"""USB_PWR: VBUS is taken to be there, whatever no pin says"""
PULL_UP, EACH_BUFFER = 1 << 16, 1 << 29
"""SIE_CTRL, and the control word of an endpoint"""
TXF0, FSTAT = 0x10, 0x04
"""of a PIO"""
ADC_HZ = 48e6
ADC_ON, ADC_SENSOR, ADC_START, ADC_READY, ADC_TEMPERATURE = 1 << 0, 1 << 1, 1 << 2, 1 << 8, 4
IO_QSPI, PADS_QSPI, SYSCFG, SYSINFO = 6, 9, 18, 19
"""bits of RESETS"""
USB, TIMER = 0x50110, 0x40054
"""blocks (address >> 12)"""
ALL_RESETS = 0x1FFFFFF
RESET_US = 1.0
"""from a release to RESET_DONE; the data sheet (2.14) names no time, so an image has to look"""
RESET_BITS = {0x50000: 2, 0x40014: 5, 0x4001C: 8, 0x50200: 10, 0x50300: 11, 0x40028: 12, 0x4002C: 13, TIMER: 21,
              0x40034: 22, USB: 24, 0x4004C: 0}  # fmt: skip
"""block -> bit of RESETS"""


def aliased(before: int, value: int, alias: int) -> int:
    """Return what a register holds after a write, toggle, set or clear (data sheet 2.1.2)."""
    return (value, before ^ value, before | value, before & ~value)[alias]


class RegisterBlock:
    """A block of registers that behave as memory, with the aliases that set, clear and toggle bits."""

    def __init__(self, initial: dict[int, int] | None = None) -> None:
        """Hold these values after a reset, 0 elsewhere."""
        self.values = dict(initial or {})

    def read_uint32(self, offset: int) -> int:
        return self.values.get(offset, 0)

    def write_uint32(self, offset: int, value: int) -> None:
        self.values[offset] = value & 0xFFFFFFFF

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        """Write, toggle, set or clear bits."""
        self.write_uint32(offset, aliased(self.read_uint32(offset) if alias else 0, value, alias))

    def reset(self) -> None:
        """Nothing: a reset makes a new chip."""


class Resets(RegisterBlock):
    """Which blocks are held in reset; those that the boot ROM releases are free from the start."""

    def __init__(self, usb_held: Callable[[], None], timer_freed: Callable[[], None],
                 now_us: Callable[[], float]) -> None:  # fmt: skip
        """Hold everything but what the boot ROM needs.

        `usb_held` hears when the USB controller is put into reset, `timer_freed` when the timer leaves it.
        """
        super().__init__()
        self._usb_held, self._timer_freed, self._now_us = usb_held, timer_freed, now_us
        self._asked = ALL_RESETS & ~(1 << IO_QSPI | 1 << PADS_QSPI | 1 << SYSCFG | 1 << SYSINFO)
        self._leaving, self._left_us = 0, 0.0

    @property
    def held(self) -> int:
        """The blocks that are in reset, or were a moment ago."""
        if self._leaving and self._now_us() >= self._left_us:
            self._leaving = 0
        return self._asked | self._leaving

    def read_uint32(self, offset: int) -> int:
        """RESET, and RESET_DONE, which follows it."""
        return {0: self._asked, 8: ~self.held & ALL_RESETS}.get(offset, self.values.get(offset, 0))

    def write_uint32(self, offset: int, value: int) -> None:
        """Hold or release."""
        if offset == 0:
            held, freed = value & ~self._asked, self._asked & ~value
            self._asked = value & ALL_RESETS
            if freed:
                self._leaving, self._left_us = self.held & ~self._asked | freed, self._now_us() + RESET_US
            if held >> RESET_BITS[USB] & 1:
                self._usb_held()
            if freed >> RESET_BITS[TIMER] & 1:
                self._timer_freed()
        else:
            super().write_uint32(offset, value)


class Guard:
    """The emulator's own block, behind a check that it is not held in reset."""

    def __init__(self, inner: Any, held: Callable[[], bool], report: Callable[[str], None]) -> None:
        """Pass accesses on unless `held`."""
        self.inner, self._held, self._report = inner, held, report

    def read_uint32(self, offset: int) -> int:
        if self._held():
            self._report(f"read of register 0x{offset:x} of a block that is held in reset")
        return int(self.inner.read_uint32(offset))

    def write_uint32(self, offset: int, value: int) -> None:
        self.write_uint32_atomic(offset, value, 0)

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        if self._held():
            self._report(f"write of register 0x{offset:x} of a block that is held in reset")
        self.inner.write_uint32_atomic(offset, value, alias)

    def reset(self) -> None:
        self.inner.reset()


class PioGuard(Guard):
    """A PIO whose FIFO loses what is written while it is full (data sheet 3.7: FDEBUG, TXOVER)."""

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        machine = (offset - TXF0) // 4
        if 0 <= machine < 4 and self.inner.read_uint32(FSTAT) >> 16 + machine & 1:
            self._report(f"PIO: a word is lost, the FIFO of state machine {machine} is full")
        super().write_uint32_atomic(offset, value, alias)


class AdcGuard(Guard):
    """The converter, which does nothing without its clock (data sheet 4.9)."""

    def __init__(self, inner: Any, held: Callable[[], bool], report: Callable[[str], None],
                 clock_hz: Callable[[], float]) -> None:  # fmt: skip
        """Convert while `clock_hz` is that of clk_adc."""
        super().__init__(inner, held, report)
        self._clock_hz = clock_hz

    def read_uint32(self, offset: int) -> int:
        """Read through; never READY without clock or power."""
        value = super().read_uint32(offset)
        works = self._clock_hz() == ADC_HZ and self.inner.cs & ADC_ON
        return value if offset or works else value & ~ADC_READY

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        super().write_uint32_atomic(offset, value, alias)
        if offset == 0 and self.inner.cs & ADC_ON and self._clock_hz() != ADC_HZ:
            self._report(f"ADC: clk_adc is {self._clock_hz() / 1e6:g} MHz, not 48 MHz")
        sensor_read = self.inner.cs & ADC_START and self.inner.cs >> 12 & 7 == ADC_TEMPERATURE
        if offset == 0 and sensor_read and not self.inner.cs & ADC_SENSOR:
            self._report("ADC: the temperature sensor is read while it has no power")


class UsbGuard(Guard):
    """The USB controller with what the emulator leaves out: frames, and what has to be on (data sheet 4.1)."""

    def __init__(self, chip: Any, held: Callable[[], bool], report: Callable[[str], None]) -> None:
        """Let a frame begin each millisecond of the emulator's clock."""
        super().__init__(chip.usb_ctrl, held, report)
        self.bus: BusyBus | None = None
        """the hub to which it is plugged, where that matters"""
        self._clock, self._dpram = chip.clock, chip.usb_dpram
        self._frame_read = 0
        self._phy: dict[int, int] = {}
        self._lines, self._attached = 0, False
        self._alarm = self._clock.create_alarm(self._begin_frame)
        self._announce = self.inner._indicate_buffer_ready
        self.inner._indicate_buffer_ready = self._buffer_done

    def unplugged(self) -> None:
        """The controller is held in reset."""
        self._lines, self._attached = 0, False
        self._phy.clear()

    def _look_attached(self) -> None:
        """A host that sees a pull-up resets the bus: controller on, data lines connected, VBUS there, pull-up on."""
        inner = self.inner
        lines = self._lines & SOFTWARE_CONNECT and self._lines & DATA_LINES
        power = inner._usb_pwr & VBUS_FORCED == VBUS_FORCED
        attached = bool(inner._main_ctrl & 1 and lines and power and inner._sie_ctrl & PULL_UP)
        if attached and not self._attached:
            inner.reset_device()
        self._attached = attached

    def _buffer_done(self, endpoint: int, out: bool) -> None:
        """Buffers whose interrupt nobody asked for pass without a word."""
        at = 8 * endpoint + 4 * out
        control = int.from_bytes(self._dpram[at : at + 4], "little") if endpoint else self.inner._sie_ctrl
        if control & EACH_BUFFER:
            self._announce(endpoint, out)
        else:
            self._report(f"USB: a buffer of endpoint {endpoint} is done, and no interrupt was asked for")

    def read_uint32(self, offset: int) -> int:
        """Read through, but for SOF_RD: the number of the frame; reading it ends the interrupt."""
        if offset in (DIRECT, OVERRIDE, MUXING):
            return self._lines if offset == MUXING else self._phy.get(offset, 0)
        value = super().read_uint32(offset)
        if offset == 0x50 and self.bus:
            return self.bus.status(value)
        if offset != 0x48:
            return value
        self._frame_read = self._frame
        self._set_raw(False)
        return self._frame_read & 0x7FF

    @property
    def _frame(self) -> int:
        return int(self._clock.nanos // FRAME_NS)

    def _begin_frame(self) -> None:
        self._set_raw(True)

    def _set_raw(self, began: bool) -> None:
        self.inner._int_raw = self.inner._int_raw & ~SOF | SOF * began
        self.inner.check_interrupts()

    def _await_frame(self) -> None:
        """A frame that began since SOF_RD was read last counts at once, as it stays noted."""
        if self._frame != self._frame_read:
            self._begin_frame()
        else:
            self._alarm.schedule((self._frame + 1) * FRAME_NS - self._clock.nanos + 1)

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        """Write through; with the interrupt of SOF enabled in INTE, wait for the next frame."""
        if offset in (DIRECT, OVERRIDE):  # which the emulator does not know
            value = self._phy[offset] = aliased(self._phy.get(offset, 0), value, alias)
        else:
            super().write_uint32_atomic(offset, value, alias)
        if offset == MUXING:
            self._lines = aliased(self._lines, value, alias)
        if self.bus and offset in (DIRECT, OVERRIDE, MUXING):
            self.bus.write(offset, value)
        self._look_attached()
        if offset == 0x90 and self.inner._int_enable & SOF:
            self._await_frame()
