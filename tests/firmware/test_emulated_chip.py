"""The emulated chip by itself: where it takes time or starts with anything; its instructions by another emulator."""

from itertools import pairwise

import pytest

from gellight.ring.firmware.image import BOOT2_BYTES
from tests.firmware.emulator.chip import PSM, WATCHDOG_SELECTION
from tests.firmware.emulator.clocks import CS, CTRL, FBDIV, LOCK_US, PWR, Crystal, Pll
from tests.firmware.emulator.registers import ALL_RESETS, RESET_US, Resets
from tests.firmware.helpers.thumb_blocks import asks_about, differences, known_wrong
from tests.helpers.bench_board import BenchBoard

TIMER_LOW, WATCHDOG_TICK, CLK_REF = 0x40054028, 0x4005802C, 0x40008030
ENABLED = 1 << 9


class Time:
    us = 0.0

    def __call__(self) -> float:
        return self.us


@pytest.mark.parametrize(("frequencies", "runs"), [(0xAA0, True), (0xAA1, False), (0xAA3, False), (0, False)])
def test_a_crystal_starts_in_the_one_range_that_is_not_reserved(frequencies: int, runs: bool) -> None:
    now_us = Time()
    crystal = Crystal(now_us, lambda: None)
    crystal.write_uint32(CTRL, 0xFAB << 12 | frequencies)
    now_us.us = 70_000
    assert (crystal.running_us > 0) == runs


def test_a_pll_locks_after_a_while_and_post_dividers_have_to_wait_for_it() -> None:
    now_us = Time()
    pll = Pll(lambda: None, now_us)
    pll.write_uint32(FBDIV, 100)
    now_us.us = 100.0
    pll.write_uint32(PWR, 0x08)
    assert not pll.read_uint32(CS) >> 31
    pll.write_uint32(PWR, 0)
    assert pll.violations() == ["its post dividers get power before it has locked"]
    now_us.us += LOCK_US
    assert pll.read_uint32(CS) >> 31
    assert not pll.violations()


def test_a_block_leaves_reset_after_a_while() -> None:
    now_us = Time()
    resets = Resets(lambda: None, lambda: None, now_us)
    resets.write_uint32(0, ALL_RESETS & ~0b100)
    assert not resets.read_uint32(8) & 0b100
    assert resets.held & 0b100
    now_us.us = RESET_US
    assert resets.read_uint32(8) & 0b100
    assert not resets.held & 0b100


def passed_us(board: BenchBoard) -> int:
    begun = board.chip.read_uint32(TIMER_LOW)
    board.run(10_000)
    return int(board.chip.read_uint32(TIMER_LOW) - begun)


def test_timer_counts_what_the_watchdog_divides_clk_ref_by(image: bytes) -> None:
    board = BenchBoard(image)
    board.run(90_000)
    assert passed_us(board) == pytest.approx(10_000, abs=2)
    board.chip.write_uint32(WATCHDOG_TICK, ENABLED | 24)
    assert passed_us(board) == pytest.approx(5_000, abs=2)
    board.chip.write_uint32(CLK_REF, 0)  # the ring oscillator
    assert passed_us(board) == pytest.approx(10_000 * 6.5 / 24, abs=2)
    board.chip.write_uint32(WATCHDOG_TICK, 12)
    assert passed_us(board) == 0


def test_memory_holds_anything_at_power_on_and_outlasts_a_reset(image: bytes) -> None:
    board = BenchBoard(image)
    unused = 0x20030000
    first = board.chip.read_uint32(unused)
    assert first == BenchBoard(image).chip.read_uint32(unused)
    board._restart()
    assert board.chip.read_uint32(unused) == first
    board.power_off()
    board.power_on()
    assert board.chip.read_uint32(unused) != first


@pytest.mark.parametrize(("selected", "restarts"), [(0x1FFFC, 1), (0, 0)])
def test_the_watchdog_resets_what_it_is_told(image: bytes, selected: int, restarts: int) -> None:
    board = BenchBoard(image)
    board.run(1_000)
    board.chip.write_uint32(PSM << 12 | WATCHDOG_SELECTION, selected)
    board.chip.write_uint32(0x40058000, 1 << 31)
    board.run(100)
    assert board.resets == restarts
    assert bool(board.faults) == (not restarts)


@pytest.mark.nightly
@pytest.mark.parametrize(("count", "longest"), [(6_000, 1), (14_000, 10)])
def test_random_blocks_leave_the_same_registers_flags_and_memory(count: int, longest: int) -> None:
    assert differences(count, 29, longest) == []


def test_the_image_asks_about_no_flag_that_the_emulator_gets_wrong(image: bytes) -> None:
    words = [int.from_bytes(image[at : at + 2], "little") for at in range(BOOT2_BYTES, len(image) - 1, 2)]
    assert any(known_wrong(word) for word in words)
    assert not [
        f"{first:04x} {second:04x}" for first, second in pairwise(words) if known_wrong(first) & asks_about(second)
    ]
