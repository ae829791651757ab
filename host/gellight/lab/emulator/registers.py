"""Register blocks in front of the emulator's: what it does not model, and accesses that real silicon would ignore."""

from collections.abc import Callable
from typing import Any

from gellight.lab.emulator.busy_bus import DIRECT, MUXING, OVERRIDE, BusyBus

FRAME_NS = 1e6
SOF = 1 << 17
"""start of frame in INTR, INTE and INTS of the USB controller"""
IO_QSPI, PADS_QSPI, SYSCFG, SYSINFO = 6, 9, 18, 19
ALL_RESETS = 0x1FFFFFF
RESET_BITS = {0x50000: 2, 0x40014: 5, 0x4001C: 8, 0x50200: 10, 0x50300: 11, 0x40028: 12, 0x4002C: 13, 0x40054: 21,
              0x40034: 22, 0x50110: 24, 0x4004C: 0}  # fmt: skip
"""block (address >> 12) -> bit of RESETS"""


class RegisterBlock:
    """A block of registers that behave as memory, with the aliases that set, clear and toggle bits."""

    def __init__(self, initial: dict[int, int] | None = None) -> None:
        """Hold these values after a reset, 0 elsewhere."""
        self.values = dict(initial or {})

    def read_uint32(self, offset: int) -> int:
        """Return a register."""
        return self.values.get(offset, 0)

    def write_uint32(self, offset: int, value: int) -> None:
        """Set a register."""
        self.values[offset] = value & 0xFFFFFFFF

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        """Write, toggle, set or clear bits (data sheet 2.1.2)."""
        before = self.read_uint32(offset)
        self.write_uint32(offset, (value, before ^ value, before | value, before & ~value)[alias])

    def reset(self) -> None:
        """Nothing: a reset makes a new chip."""


class Resets(RegisterBlock):
    """Which blocks are held in reset; those that the boot ROM releases are free from the start."""

    def __init__(self, usb_held: Callable[[], None]) -> None:
        """Hold everything but what the boot ROM needs; `usb_held` hears when the USB controller is put into reset."""
        super().__init__()
        self._usb_held = usb_held
        self.held = ALL_RESETS & ~(1 << IO_QSPI | 1 << PADS_QSPI | 1 << SYSCFG | 1 << SYSINFO)

    def read_uint32(self, offset: int) -> int:
        """RESET, and RESET_DONE as its complement."""
        return {0: self.held, 8: ~self.held & ALL_RESETS}.get(offset, self.values.get(offset, 0))

    def write_uint32(self, offset: int, value: int) -> None:
        """Hold or release."""
        if offset == 0:
            newly = value & ~self.held
            self.held = value & ALL_RESETS
            if newly >> RESET_BITS[0x50110] & 1:
                self._usb_held()
        else:
            super().write_uint32(offset, value)


class Guard:
    """The emulator's own block, behind a check that it is not held in reset."""

    def __init__(self, inner: Any, held: Callable[[], bool], report: Callable[[str], None]) -> None:
        """Pass accesses on unless `held`."""
        self.inner, self._held, self._report = inner, held, report

    def read_uint32(self, offset: int) -> int:
        """Read through."""
        if self._held():
            self._report(f"read of register 0x{offset:x} of a block that is held in reset")
        return int(self.inner.read_uint32(offset))

    def write_uint32(self, offset: int, value: int) -> None:
        """Write through."""
        self.write_uint32_atomic(offset, value, 0)

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        """Write through."""
        if self._held():
            self._report(f"write of register 0x{offset:x} of a block that is held in reset")
        self.inner.write_uint32_atomic(offset, value, alias)

    def reset(self) -> None:
        """Reset the block."""
        self.inner.reset()


class UsbGuard(Guard):
    """The USB controller with what the emulator leaves out: the start of a frame (data sheet 4.1)."""

    def __init__(self, chip: Any, held: Callable[[], bool], report: Callable[[str], None]) -> None:
        """Let a frame begin each millisecond of the emulator's clock."""
        super().__init__(chip.usb_ctrl, held, report)
        self.bus: BusyBus | None = None
        """the hub to which it is plugged, where that matters"""
        self._clock = chip.clock
        self._frame_read = 0
        self._phy: dict[int, int] = {}
        self._alarm = self._clock.create_alarm(self._begin_frame)

    def read_uint32(self, offset: int) -> int:
        """Read through, but for SOF_RD: the number of the frame; reading it ends the interrupt."""
        if offset in (DIRECT, OVERRIDE):
            return self._phy.get(offset, 0)
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
            before = self._phy.get(offset, 0)
            value = self._phy[offset] = (value, before ^ value, before | value, before & ~value)[alias]
        else:
            super().write_uint32_atomic(offset, value, alias)
        if self.bus and offset in (DIRECT, OVERRIDE, MUXING):
            self.bus.write(offset, value)
        if offset == 0x90 and self.inner._int_enable & SOF:
            self._await_frame()


class FlashBus(RegisterBlock):
    """The serial interface to the flash as far as the firmware drives it by itself: command 4Bh, the unique number."""

    def __init__(self, unique_id: bytes, divided: Callable[[int], None]) -> None:
        """Answer 4Bh with this number; `divided` hears by what the clock of the flash is divided."""
        super().__init__()
        self._divided = divided
        self._unique_id = unique_id
        self._sent = 0
        self._command = 0
        self._answers: list[int] = []

    def select(self, selected: bool) -> None:
        """Chip select: a command begins."""
        self._sent = 0
        self._answers.clear()

    def read_uint32(self, offset: int) -> int:
        """DR0 gives what came back; SR whether there is any."""
        if offset == 0x28:
            return 0x6 | (0x8 if self._answers else 0)
        if offset == 0x60:
            return self._answers.pop(0) if self._answers else 0
        return super().read_uint32(offset)

    def write_uint32(self, offset: int, value: int) -> None:
        """DR0 sends a byte, and one comes back."""
        super().write_uint32(offset, value)
        if offset == 0x14:
            self._divided(value)
        if offset != 0x60:
            return
        if self._sent == 0:
            self._command = value & 0xFF
        position = self._sent - 5  # after the command and four dummy bytes
        known = self._command == 0x4B and 0 <= position < 8
        self._answers.append(self._unique_id[position] if known else 0xFF)
        self._sent += 1
