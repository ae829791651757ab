"""Random blocks of Thumb instructions (ARMv6-M), run by the emulator's processor and by Unicorn's, and compared.

Unicorn is QEMU's processor. It is under the GPL and serves the tests alone: nothing of it is shipped. A block has
instructions of every class that the Cortex-M0+ has, but for those that leave the block or change the mode. r7 and r6
hold a base and an offset for loads and stores and are written by nothing else, so every address is in the memory.
"""

import random
import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

from rp2040py.rp2040 import RP2040

CODE, CODE_BYTES, DATA, DATA_BYTES = 0x20000000, 0x100, 0x20010000, 0x1000
BASE, STACK = DATA + 0x400, DATA + 0xC00
EDGES = (0, 1, 2, 31, 32, 33, 255, 256, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFE, 0xFFFFFFFF)
LONGEST = 10
MOST_STEPS = 64
FLAGS_AT = 28


class Start(NamedTuple):
    """A block and the state it begins in."""

    code: bytes
    registers: tuple[int, ...]
    """r0 to r7; r8 to r12"""
    flags: int
    """NZCV"""


class State(NamedTuple):
    """What a block leaves behind."""

    registers: tuple[int, ...]
    """r0 to r14"""
    flags: int
    memory: bytes


def _low(chance: random.Random) -> int:
    return chance.randrange(6)


def _shifted(chance: random.Random) -> int:
    """Shifts by a constant, and sums of two registers or of one and a small constant."""
    if chance.random() < 0.5:
        return chance.randrange(3) << 11 | chance.randrange(32) << 6 | chance.randrange(8) << 3 | _low(chance)
    return 3 << 11 | chance.randrange(32) << 6 | chance.randrange(8) << 3 | _low(chance)


def _constant(chance: random.Random) -> int:
    return 1 << 13 | chance.randrange(4) << 11 | _low(chance) << 8 | chance.randrange(256)


def _arithmetic(chance: random.Random) -> int:
    return 0x4000 | chance.randrange(16) << 6 | chance.randrange(8) << 3 | _low(chance)


def _high(chance: random.Random) -> int:
    """ADD, CMP and MOV with the high registers, but for stack pointer and program counter."""
    operation = chance.randrange(3)
    to = chance.choice((0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 14))
    source = chance.choice((8, 9, 10, 11, 12, 14) if to < 8 else (*range(13), 14))
    return 0x4400 | operation << 8 | (to & 8) << 4 | source << 3 | to & 7


def _by_register(chance: random.Random) -> int:
    return 0x5000 | chance.randrange(8) << 9 | 6 << 6 | 7 << 3 | _low(chance)


def _by_constant(chance: random.Random) -> int:
    kind = chance.choice((0x6000, 0x6800, 0x7000, 0x7800, 0x8000, 0x8800))
    return kind | chance.randrange(32) << 6 | 7 << 3 | _low(chance)


def _by_stack(chance: random.Random) -> int:
    return chance.choice((0x9000, 0x9800)) | _low(chance) << 8 | chance.randrange(64)


def _addresses(chance: random.Random) -> int:
    return chance.choice((0x4800, 0xA000, 0xA800)) | _low(chance) << 8 | chance.randrange(64)


def _widened(chance: random.Random) -> int:
    kind = chance.choice((0xB200, 0xB240, 0xB280, 0xB2C0, 0xBA00, 0xBA40, 0xBAC0))
    return kind | chance.randrange(8) << 3 | _low(chance)


def _several(chance: random.Random) -> int:
    """PUSH and POP, and moves of the stack pointer by what they take."""
    return chance.choice((0xB400, 0xBC00, 0xB000, 0xB080)) | chance.randrange(1, 64)


def _pass(chance: random.Random) -> int:
    return chance.choice((0xBF00, 0xBF00, 0x1C00 | _low(chance)))


KINDS: tuple[tuple[int, Callable[[random.Random], int]], ...] = (
    (6, _shifted), (4, _constant), (8, _arithmetic), (4, _high), (3, _by_register), (4, _by_constant),
    (2, _by_stack), (2, _addresses), (3, _widened), (1, _several), (1, _pass),
)  # fmt: skip
CALL, JUMP, BRANCH = 0xF800, 0xE000, 0xD000
"""to a later instruction: how many halfwords on is filled in once they are known"""


SHIFTS, CARRIED = (2, 3, 4, 7), (5, 6)
"""of the arithmetic instructions: LSLS, LSRS, ASRS, RORS by a register; ADCS, SBCS"""


def _wide(chance: random.Random, reads: bool) -> list[int]:
    """MRS or MSR of the flags, not both in one block: QEMU keeps the bit Q, which ARMv6-M lacks; or a barrier."""
    if chance.random() < 0.5:
        return [0xF3BF, 0x8F5F]
    return [0xF3EF, 0x8000 | _low(chance) << 8] if reads else [0xF380 | _low(chance), 0x8800]


def _instruction(chance: random.Random, reads: bool) -> list[int]:
    kind = chance.random()
    if kind < 0.08:
        return [BRANCH | chance.randrange(14) << 8]
    if kind < 0.1:
        return [JUMP]
    if kind < 0.12:
        return [0xF000, CALL]
    if kind < 0.16:
        return _wide(chance, reads)
    weights, kinds = zip(*KINDS, strict=True)
    return [chance.choices(kinds, weights)[0](chance)]


def known_wrong(word: int) -> int:
    """Return the flag (of NZCV) that the emulator may get wrong after an instruction, and the image never asks about.

    C, where a register shifts by 0 or by more than 32; V, where a sum with carry ends at 2^31.
    """
    operation = word >> 6 & 15 if word >> 10 == 0x10 else -1
    return 2 * (operation in SHIFTS) | (operation in CARRIED)


def asks_about(word: int) -> int:
    """Return which of C and V an instruction of 16 bits goes by."""
    if word >> 12 == 0xD:
        condition = word >> 8 & 15
        return 2 * (condition in (2, 3, 8, 9)) | (condition in (6, 7, 10, 11, 12, 13))
    return 2 * (word >> 6 in (0x105, 0x106))


def _jumping(words: list[int], skipped: list[list[int]]) -> list[int]:
    """Return a jump over the instructions that follow it."""
    distance = sum(map(len, skipped))
    if words[-1] == CALL:
        return [words[0], CALL | distance]
    if words[0] == JUMP or (len(words) == 1 and words[0] >> 12 == BRANCH >> 12):
        return [words[0] | (distance - 1) & (0x7FF if words[0] == JUMP else 0xFF)]
    return words


def random_start(chance: random.Random, longest: int = LONGEST) -> Start:
    """Return a block, and registers full of numbers at which carries and signs change.

    In a block of several instructions a comparison follows what is `known_wrong`.
    """
    reads = chance.random() < 0.5
    block = [_instruction(chance, reads) for _ in range(chance.randint(1, longest))]
    if longest > 1:
        block = [[*words, 0x4280 | chance.randrange(64)] if known_wrong(words[0]) else words for words in block]
    words = list[int]()
    for number, instruction in enumerate(block):
        words += _jumping(instruction, block[number + 1 : number + 1 + chance.randrange(3)])
    words.append(0xBF00)  # the end
    values = [chance.choice(EDGES) if chance.random() < 0.5 else chance.getrandbits(32) for _ in range(11)]
    registers = (*values[:6], 4 * chance.randrange(32), BASE, *values[6:])
    return Start(struct.pack(f"<{len(words)}H", *words), registers, chance.randrange(16))


class Emulated:
    """The processor of the RP2040's emulator."""

    def __init__(self) -> None:
        self._chip = RP2040()
        self.complaints: list[str] = []
        ignore = lambda *_: None  # noqa: E731
        self._chip.logger = SimpleNamespace(debug=ignore, info=ignore, warning=self._complain, warn=self._complain,
                                            error=self._complain)  # fmt: skip

    def _complain(self, *words: object) -> None:
        self.complaints.append(" ".join(map(str, words)))

    def run(self, start: Start, memory: bytes) -> State:
        """Run a block to its end."""
        chip, core = self._chip, self._chip.core
        at, end = CODE - 0x20000000, CODE + len(start.code)
        chip.sram[at : at + len(start.code)] = start.code
        chip.sram[DATA - 0x20000000 : DATA - 0x20000000 + DATA_BYTES] = memory
        for number, value in enumerate((*start.registers, STACK, 0xFFFFFFFF)):
            core.registers[number] = value
        core.n, core.z, core.c, core.v = (bool(start.flags >> bit & 1) for bit in (3, 2, 1, 0))
        core.pc = CODE
        for _ in range(MOST_STEPS):
            if core.pc >= end - 2:
                break
            core.execute_instruction()
        flags = core.n << 3 | core.z << 2 | core.c << 1 | core.v
        registers = tuple(int(core.registers[number]) & 0xFFFFFFFF for number in range(15))
        return State(registers, flags, bytes(chip.sram[DATA - 0x20000000 : DATA - 0x20000000 + DATA_BYTES]))


class Unicorn:
    """QEMU's processor."""

    def __init__(self) -> None:
        import unicorn
        from unicorn import arm_const

        self._core: Any = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._core.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M0)
        self._core.mem_map(CODE, 0x20000)
        self._names = [getattr(arm_const, f"UC_ARM_REG_R{number}") for number in range(13)]
        self._names += [arm_const.UC_ARM_REG_SP, arm_const.UC_ARM_REG_LR, arm_const.UC_ARM_REG_XPSR]

    def run(self, start: Start, memory: bytes) -> State:
        """Run a block to its end."""
        core = self._core
        core.mem_write(CODE, start.code)
        core.ctl_remove_cache(CODE, CODE + CODE_BYTES)  # of the block before
        core.mem_write(DATA, memory)
        status = start.flags << FLAGS_AT | 1 << 24
        core.reg_write_batch(list(zip(self._names, (*start.registers, STACK, 0xFFFFFFFF, status), strict=True)))
        core.emu_start(CODE | 1, CODE + len(start.code) - 2)
        *registers, status = core.reg_read_batch(self._names)
        return State(tuple(registers), status >> FLAGS_AT, bytes(core.mem_read(DATA, DATA_BYTES)))


def differences(count: int, seed: int, longest: int = LONGEST) -> list[str]:
    """Run so many random blocks in both, and describe those that do not end alike, but for flags known to be wrong."""
    chance, found = random.Random(seed), list[str]()
    ours, theirs = Emulated(), Unicorn()
    memory = random.Random(seed + 1).randbytes(DATA_BYTES)
    for number in range(count):
        start = random_start(chance, longest)
        got, expected = ours.run(start, memory), theirs.run(start, memory)
        wrong = known_wrong(int.from_bytes(start.code[:2], "little")) if longest == 1 else 0
        if got._replace(flags=got.flags & ~wrong) != expected._replace(flags=expected.flags & ~wrong):
            found.append(f"block {number}: {start.code.hex(' ', 2)} from {start}: {got[:2]}, expected {expected[:2]}")
    return found + ours.complaints
