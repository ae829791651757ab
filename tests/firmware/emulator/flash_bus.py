"""The SSI between processor and flash (data sheet 4.10), execute in place (XIP), and what the boot ROM does with them.

The processor sees the flash only while the SSI is set up for a command that the chip knows, has chip select to itself,
and the chip is not busy. What it has cached it goes on seeing until the cache is flushed.
"""

from collections.abc import Callable
from typing import Any

from tests.firmware.emulator.flash_chip import (
    ERASE_SECTOR,
    PAGE,
    PROGRAM,
    PROGRAM_NS,
    READ,
    READ_STATUS,
    SECTOR,
    WRITE_ENABLE,
    FlashChip,
)
from tests.firmware.emulator.registers import RegisterBlock

CTRLR0, CTRLR1, SSIENR, SER, BAUDR, SR, DR0, SPI_CTRLR0 = 0x00, 0x04, 0x08, 0x10, 0x14, 0x28, 0x60, 0xF4
SET_WHILE_OFF = (CTRLR0, CTRLR1, BAUDR, SPI_CTRLR0)
"""registers that the SSI ignores while it is on"""
FIFO = 16
RAN_ASTRAY = 0xBD
"""the number of the breakpoints that stand where the flash cannot be read: code that runs there stops"""
RUBBISH = bytes((RAN_ASTRAY, 0xBE))
BYTES_BOTH_WAYS = 7 << 16
WORDS_AFTER_A_COMMAND = 31 << 16 | 3 << 8
READ_03 = READ << 24 | 2 << 8 | 6 << 2
"""SPI_CTRLR0: 8 bits of command and 24 of address on one line, no wait"""
READ_0B = 0x0B << 24 | 8 << 11 | 2 << 8 | 6 << 2
"""and with 8 cycles of wait"""
SERIAL_DIVIDER, XIP_DIVIDER = 6, 4
"""what the functions of the boot ROM divide clk_sys by"""
LOOKS, MOST_LOOKS = 50, 400
"""of the boot ROM at the status, in the time that is expected, and at most"""
FORCED_LOW, FORCED_HIGH = 2, 3
"""OUTOVER in the CTRL of chip select"""


class FlashBus(RegisterBlock):
    """The SSI with its chip select, and the flash as the processor sees it."""

    def __init__(self, chip: Any, flash: FlashChip, divided: Callable[[int], None], byte_ns: Callable[[int], float],
                 report: Callable[[str], None]) -> None:  # fmt: skip
        """Stand as the boot ROM leaves it for boot2.

        `divided` hears by what the clock of the flash is divided; `byte_ns` tells how long a byte takes then.
        """
        super().__init__({SSIENR: 1, CTRLR0: BYTES_BOTH_WAYS, BAUDR: SERIAL_DIVIDER, SER: 1})
        self.flash, self._view, self._select = flash, chip.flash, chip.qspi[1]
        self._divided, self._byte_ns, self._report = divided, byte_ns, report
        self._clock, self._arrived_ns = chip.clock, 0.0
        """when the last byte has passed: as many clocks of the flash as it has bits after it was sent (4.10.5)"""
        self._received: list[int] = []
        self._cached: list[tuple[int, bytes]] = []
        self._seen: bool | None = None
        flash.changed = lambda offset, before: self._cached.append((offset, before))
        flash.select(False)
        self._select.add_listener(lambda _new, _old: self._selected())
        self._look()

    @property
    def readable(self) -> bool:
        """The processor can read the flash."""
        values = self.values
        serial = values.get(CTRLR0) == WORDS_AFTER_A_COMMAND and not values.get(CTRLR1)
        command = values.get(SPI_CTRLR0) in (READ_03, READ_0B)
        clocked = values.get(BAUDR, 0) & 0xFFFE and values.get(SSIENR) and values.get(SER)
        return bool(serial and command and clocked and not self._forced and not self.flash.busy)

    @property
    def _forced(self) -> int:
        return int(self._select.ctrl >> 8 & 3)

    def _selected(self) -> None:
        self.flash.select(self._forced == FORCED_LOW)
        self._look()

    def _look(self) -> None:
        """Show the processor the flash, or rubbish."""
        readable = self.readable
        if readable == self._seen:
            return
        self._seen = readable
        size = len(self.flash.cells)
        self._view[:size] = self.flash.cells if readable else RUBBISH * (size // 2)
        for offset, before in reversed(self._cached if readable else []):
            self._view[offset : offset + len(before)] = before

    def flush(self) -> None:
        self._cached.clear()

    def read_uint32(self, offset: int) -> int:
        """DR0 gives what came back; SR whether there is any."""
        if offset == SR:
            return 0x6 | (0x8 if self._came() else 0)
        if offset != DR0:
            return super().read_uint32(offset)
        if not self._came():
            self._report("SSI: nothing has come that could be read")
            return 0
        return self._received.pop(0)

    def _came(self) -> bool:
        """Whether the oldest byte that was not read yet has passed."""
        passing = max(len(self._received) - 1, 0) * self._byte_ns(self.values[BAUDR])
        return bool(self._received) and self._clock.nanos >= self._arrived_ns - passing

    def write_uint32(self, offset: int, value: int) -> None:
        """DR0 sends a byte, and one comes back."""
        if offset in SET_WHILE_OFF and self.values[SSIENR] and value != self.values.get(offset):
            self._report(f"SSI: register 0x{offset:02x} is set while the SSI is on, which ignores it (4.10.13)")
            return
        if offset == DR0:
            self._send(value & 0xFF)
            self._arrived_ns = max(self._arrived_ns, self._clock.nanos) + self._byte_ns(self.values[BAUDR])
            return
        super().write_uint32(offset, value)
        if offset == SSIENR and not value:
            self._received.clear()
        if offset == BAUDR:
            self._divided(value)
        self._look()

    def _send(self, byte: int) -> None:
        values = self.values
        if not (values[SSIENR] and values[SER] and values[CTRLR0] == BYTES_BOTH_WAYS and values[BAUDR]):
            self._report("SSI: a byte is sent while it is off, or not set up for bytes both ways")
            return
        if len(self._received) == FIFO:
            self._report("SSI: more has come than it can hold")
            return
        self._received.append(self.flash.exchange(byte))


class RomFlash:
    """The functions of the boot ROM for the flash (2.8.3.1.3), by real transfers; `elapsed_ns` is what they took."""

    def __init__(self, bus: FlashBus, select_block: Any, cycle_ns: Callable[[], float],
                 report: Callable[[str], None]) -> None:  # fmt: skip
        """Drive the SSI, and chip select by the registers of IO_QSPI."""
        self.elapsed_ns = 0.0
        self._bus, self._select_block, self._cycle_ns, self._report = bus, select_block, cycle_ns, report
        self._connected = False

    def connect(self) -> None:
        """IF: the pads are the SSI's again, nothing is forced."""
        self._force(0)
        self._connected = True

    def leave_xip(self) -> None:
        """EX: the chip leaves continuous reading, the SSI sends bytes, and the ROM drives chip select."""
        if not self._connected:
            self._report("execute in place is left before the flash is connected (data sheet 2.8.3.1.3)")
        self._set_up(SERIAL_DIVIDER, BYTES_BOTH_WAYS)
        self._force(FORCED_HIGH)

    def flush(self) -> None:
        """FC: the cache is emptied, and chip select is the SSI's again."""
        self._bus.flush()
        self._force(0)

    def enter_xip(self) -> None:
        """CX: plain reads by 03h."""
        self._connected = False
        self._bus.write_uint32(SSIENR, 0)
        self._bus.write_uint32(SPI_CTRLR0, READ_03)
        self._set_up(XIP_DIVIDER, WORDS_AFTER_A_COMMAND)

    def erase(self, offset: int, count: int) -> None:
        """RE: whole sectors; those of a chip without larger blocks."""
        for start in range(offset, offset + count, SECTOR):
            self._command(bytes((WRITE_ENABLE,)))
            self._command(bytes((ERASE_SECTOR, *start.to_bytes(3, "big"))))
            self._await_idle(self._bus.flash.erase_ns)

    def program(self, offset: int, data: bytes) -> None:
        """RP: whole pages."""
        for start in range(0, len(data), PAGE):
            self._command(bytes((WRITE_ENABLE,)))
            self._command(bytes((PROGRAM, *(offset + start).to_bytes(3, "big"))) + data[start : start + PAGE])
            self._await_idle(PROGRAM_NS)

    def _await_idle(self, step_ns: float) -> None:
        for _ in range(MOST_LOOKS):
            if not self._command(bytes((READ_STATUS, 0)))[1] & 1:
                return
            self.elapsed_ns += step_ns / LOOKS
        self._report("the boot ROM waits for a flash that does not answer")

    def _command(self, sent: bytes) -> bytes:
        """Exchange bytes between two edges of chip select."""
        self._force(FORCED_LOW)
        came = bytearray()
        for byte in sent:
            self._bus._send(byte)
            self.elapsed_ns += 8 * self._bus.values[BAUDR] * self._cycle_ns()
            came.append(self._bus._received.pop(0) if self._bus._received else 0)
        self._force(FORCED_HIGH)
        return bytes(came)

    def _set_up(self, divider: int, frames: int) -> None:
        for register, value in ((SSIENR, 0), (BAUDR, divider), (CTRLR0, frames), (CTRLR1, 0), (SER, 1), (SSIENR, 1)):
            self._bus.write_uint32(register, value)

    def _force(self, override: int) -> None:
        control = self._bus._select.ctrl
        self._select_block.write_uint32(0x0C, control & ~0x300 | override << 8)
