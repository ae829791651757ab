"""A stand-in for the boot ROM: finds, checks and starts boot2 as the real one does, and programs the flash.

The real ROM is not ours to distribute. The functions that firmware looks up are two instructions each: a breakpoint,
which hands over to Python, and a return.
"""

import struct
from enum import IntEnum


class Function(IntEnum):
    """What firmware may look up, and the breakpoint that stands for it."""

    IF = 1
    """connect the flash"""
    EX = 2
    """leave execute-in-place"""
    RE = 3
    """erase a range"""
    RP = 4
    """program a range"""
    FC = 5
    """flush the cache"""
    CX = 6
    """return to execute-in-place"""
    UB = 7
    """start the USB boot loader"""


ROM_BYTES = 16384
BOOT2_RAM = 0x20041F00
_TABLE, _CODE, _LOOKUP = 0x200, 0x300, 0x180
# adds r0, 4 bytes an entry, until its code is r1's; returns its address, or 0
_LOOKUP_CODE = (0x8802, 0x2A00, 0xD005, 0x428A, 0xD001, 0x3004, 0xE7F8, 0x8840, 0x4770, 0x2000, 0x4770)


def rom_words() -> list[int]:
    """Return the 4096 words of the ROM."""
    rom = bytearray(ROM_BYTES)
    struct.pack_into("<II", rom, 0, BOOT2_RAM, 0x101)
    rom[0x10:0x14] = b"Mu\x01\x02"
    struct.pack_into("<3H", rom, 0x14, _TABLE, 0, _LOOKUP | 1)
    for position, function in enumerate(Function):
        code = _CODE + 4 * position
        struct.pack_into("<2sH", rom, _TABLE + 4 * position, function.name.encode(), code | 1)
        struct.pack_into("<2H", rom, code, 0xBE00 | function, 0x4770)
    struct.pack_into(f"<{len(_LOOKUP_CODE)}H", rom, _LOOKUP, *_LOOKUP_CODE)
    return list(struct.unpack(f"<{ROM_BYTES // 4}I", rom))
