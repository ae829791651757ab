"""What can be told of an image for the RP2350 without the chip: its file, its boot block, and how it starts.

Unicorn's Cortex-M33 executes the image from the reset to the main loop; registers answer what the data sheet says of a
chip where every clock and PLL is ready, and every write is noted. The boot ROM is a stub that returns.
"""

import contextlib
import struct
from typing import Any

FLASH, FLASH_BYTES, RAM, RAM_BYTES = 0x10000000, 2 << 20, 0x20000000, 520 << 10
BLOCK_START, BLOCK_END, LAST_ITEM = 0xFFFFDED3, 0xAB123579, 0xFF
LOOKUP_AT, LOOKUP, FUNCTION = 0x16, 0x100, 0x200
RESET_DONE, RESET, XOSC_STATUS, PLL_SYS, PLL_USB = 0x40020008, 0x40020000, 0x40048004, 0x40050000, 0x40058000
REF_CTRL, REF_SELECTED, SYS_CTRL, SYS_SELECTED, ADC_CS, TIMER_LOW = (
    0x40010030, 0x40010038, 0x4001003C, 0x40010044, 0x400A0000, 0x400B0028)  # fmt: skip
ALL_RESETS = 0x1FFFFFFF
INSTRUCTIONS = 400_000
WAIT_FOR_EVENT = 0xBF20


def uf2_blocks(file: bytes) -> list[tuple[int, int, bytes]]:
    """Return family, address and payload of each block of a UF2 file (its specification alone)."""
    blocks = []
    for at in range(0, len(file), 512):
        first, second, flags, address, size, number, count, family = struct.unpack_from("<8I", file, at)
        assert (first, second, flags) == (0x0A324655, 0x9E5D5157, 0x2000)
        assert struct.unpack_from("<I", file, at + 508)[0] == 0x0AB16F30
        assert (number, count) == (at // 512, len(file) // 512)
        blocks.append((family, address, file[at + 32 : at + 32 + size]))
    return blocks


def block_loop(image: bytes) -> list[dict[int, int]]:
    """Return the items of each boot block, as the boot ROM finds them (data sheet 5.9.1): type and first word."""
    words = struct.unpack(f"<{len(image) // 4}I", image[: len(image) // 4 * 4])
    start = at = words.index(BLOCK_START, 0, 1024)
    found = []
    while True:
        items, size, place = {}, 0, at + 1
        while words[place] & 0xFF != LAST_ITEM:
            items[words[place] & 0xFF] = words[place]
            length = words[place] >> 8 & 0xFF
            size, place = size + length, place + length
        assert words[place] >> 8 & 0xFFFF == size
        assert words[place + 2] == BLOCK_END
        found.append(items)
        at += struct.unpack("<i", struct.pack("<I", words[place + 1]))[0] // 4
        if at == start:
            return found


class StartedChip:
    """An RP2350 as far as the firmware touches it while it starts."""

    def __init__(self, image: bytes) -> None:
        """Switch the power on and run until the firmware waits for something."""
        self.writes: list[tuple[int, int]] = []
        """address, without the alias, and what the register is from then on"""
        self._registers: dict[int, int] = {RESET: ALL_RESETS}
        self._micros = 0
        import unicorn
        from unicorn import arm_const

        core = self.core = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        core.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M33)
        core.mem_map(0, 0x8000)
        core.mem_map(FLASH, FLASH_BYTES)
        core.mem_map(RAM, RAM_BYTES)
        core.mem_write(LOOKUP_AT, struct.pack("<H", LOOKUP | 1))
        core.mem_write(LOOKUP, struct.pack("<3H", 0x2002, 0x0200, 0x3001) + struct.pack("<H", 0x4770))  # 0x201
        core.mem_write(FUNCTION, struct.pack("<H", 0x4770))
        core.mem_write(FLASH, image.ljust(FLASH_BYTES, b"\xff"))
        for base, size in (
            (0x40000000, 0x200000),
            (0x50000000, 0x600000),
            (0xD0000000, 0x1000),
            (0xE0000000, 0x100000),
        ):
            core.mmio_map(base, size, self._read, base, self._write, base)
        stack, reset = struct.unpack_from("<II", image)
        core.reg_write(arm_const.UC_ARM_REG_SP, stack)
        with contextlib.suppress(unicorn.UcError):  # which also ends at WFE; `sleeps` tells whether it was that
            core.emu_start(reset, 0, count=INSTRUCTIONS)
        at = core.reg_read(arm_const.UC_ARM_REG_PC)
        words = struct.unpack("<2H", core.mem_read(at - 2, 4)) if RAM < at < RAM + RAM_BYTES else ()
        self.sleeps = WAIT_FOR_EVENT in words
        """whether the processor stands at WFE, in RAM"""

    def _read(self, _: Any, offset: int, size: int, base: int) -> int:
        address = base + offset
        self._micros += 1
        value = self._registers.get(address & ~3, 0)
        answers = {
            RESET_DONE: ~self._registers[RESET] & ALL_RESETS, XOSC_STATUS: 1 << 31, TIMER_LOW: self._micros,
            PLL_SYS: value | 1 << 31, PLL_USB: value | 1 << 31, ADC_CS: value | 1 << 8,
            REF_SELECTED: 1 << (self._registers.get(REF_CTRL, 0) & 3),
            SYS_SELECTED: 1 << (self._registers.get(SYS_CTRL, 0) & 1),
        }  # fmt: skip
        return answers.get(address & ~3, value) >> 8 * (address & 3) & (1 << 8 * size) - 1

    def _write(self, _: Any, offset: int, size: int, value: int, base: int) -> None:
        address, alias = base + offset, 0
        if base in (0x40000000, 0x50000000) and not 0x50100000 <= address < 0x50110000:
            alias, address = address >> 12 & 3, address & ~0x3000
        before = self._registers.get(address, 0)
        after = (value, before ^ value, before | value, before & ~value)[alias] & 0xFFFFFFFF
        self._registers[address] = after
        self.writes.append((address, after))

    def register(self, address: int) -> int:
        """Return what was written last."""
        return self._registers.get(address, 0)
