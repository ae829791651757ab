"""The serial flash chip of a board, one command at a time: write enable, erase and program times, unique number.

Commands and times are those of the W25Q16JV that a Pico has (its data sheet, 8.1 and 9.6).
"""

from collections.abc import Callable

WRITE_ENABLE, READ_STATUS, READ, PROGRAM, ERASE_SECTOR, READ_UNIQUE_ID = 0x06, 0x05, 0x03, 0x02, 0x20, 0x4B
ADDRESS_END = 4
"""bytes of a command with its address"""
UNIQUE_AT = 5
"""the command and four dummy bytes"""
SECTOR, PAGE = 4096, 256
ERASE_NS, WORN_ERASE_NS, PROGRAM_NS = 45e6, 400e6, 0.7e6
"""typical times, and what an erase takes at most"""
BUSY, WRITABLE = 1, 2
"""of the status register"""


class FlashChip:
    """What the chip holds, and what it makes of the bytes between two edges of its chip select."""

    def __init__(self, cells: bytearray, unique_id: bytes, now_ns: Callable[[], float],
                 report: Callable[[str], None]) -> None:  # fmt: skip
        """Hold `cells`, which the chip changes."""
        self.cells = cells
        self.erase_ns = ERASE_NS
        self.until_cut: Callable[[int], int] = int
        """of so many bytes that are erased or programmed, how many are done before power fails"""
        self.changed: Callable[[int, bytes], None] = lambda offset, before: None
        """hears from where on which bytes were replaced"""
        self._unique_id, self._now_ns, self._report = unique_id, now_ns, report
        self._busy_until_ns = 0.0
        self._writable = self._selected = False
        self._sent = bytearray()

    @property
    def busy(self) -> bool:
        """It erases or programs, and answers nothing but its status."""
        return self._now_ns() < self._busy_until_ns

    def select(self, selected: bool) -> None:
        """Move chip select; a command takes effect as it rises."""
        if self._selected and not selected and self._sent:
            self._finish()
        self._selected = selected
        self._sent.clear()

    def exchange(self, byte: int) -> int:
        """Take a byte and give one."""
        if not self._selected:
            return 0xFF
        if not self._sent and self.busy and byte != READ_STATUS:
            self._report(f"the flash gets command {byte:02x} while it is busy")
        self._sent.append(byte)
        position = len(self._sent) - 1
        return self._answer(self._sent[0], position) if position else 0xFF

    def _answer(self, command: int, position: int) -> int:
        if command == READ_STATUS:
            return BUSY * self.busy | WRITABLE * self._writable
        if command == READ_UNIQUE_ID:
            return self._unique(position - UNIQUE_AT)
        return self._cell(position - ADDRESS_END) if command == READ else 0xFF

    def _unique(self, position: int) -> int:
        return self._unique_id[position] if 0 <= position < len(self._unique_id) else 0xFF

    def _cell(self, position: int) -> int:
        return self.cells[(self._address + position) % len(self.cells)] if position >= 0 else 0xFF

    @property
    def _address(self) -> int:
        return int.from_bytes(self._sent[1:ADDRESS_END], "big") % len(self.cells)

    def _finish(self) -> None:
        command, complete = self._sent[0], len(self._sent) >= ADDRESS_END
        if command == WRITE_ENABLE:
            self._writable = True
        elif command in (ERASE_SECTOR, PROGRAM) and complete:
            if not self._writable or self.busy:
                self._report(f"the flash ignores command {command:02x}: it is busy, or not enabled for writing")
                return
            self._writable = False
            self._change(command == ERASE_SECTOR)

    def _change(self, erase: bool) -> None:
        start = self._address & ~((SECTOR if erase else PAGE) - 1)
        end = start + (SECTOR if erase else PAGE)
        before = bytes(self.cells[start:end])
        if erase:
            done = self.until_cut(SECTOR)
            self.cells[start : start + done] = b"\xff" * done
        else:
            data = self._sent[ADDRESS_END:]
            for i in range(self.until_cut(len(data))):
                self.cells[start + (self._address + i) % PAGE] &= data[i]  # programming only clears bits
        self._busy_until_ns = self._now_ns() + (self.erase_ns if erase else PROGRAM_NS)
        self.changed(start, before)
