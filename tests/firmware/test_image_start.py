"""The start of the committed image: clocks that keep the data sheet, and a new start when it hangs or breaks down."""

from collections.abc import Callable

import pytest

from gellight.ring.enumerations import ResetReason
from gellight.ring.light_ring import LightRing
from tests.firmware.helpers.examined_board import break_down
from tests.helpers.bench_board import RED, BenchBoard, VirtualTransport

AFTER_US = 1_500, 64_700, 70_000
"""it waits for the crystal, copies, and has begun; at night at the other end of each, too"""
OTHER_ENDS_US = (pytest.param(us, marks=pytest.mark.nightly) for us in (40_000, 65_300, 65_800))


def hang(board: BenchBoard) -> None:
    """No instruction gets through any more, and no interrupt."""
    board.chip.write_uint32(0x2003FF00, 0xE7FEE7FE)  # b . ; b .
    board.chip.core.pc, board.chip.core.pm, board.chip.core.waiting = 0x2003FF00, True, False


@pytest.mark.parametrize("after_us", [*AFTER_US, *OTHER_ENDS_US])
@pytest.mark.parametrize(
    ("disturb", "reason"), [(hang, ResetReason.WATCHDOG), (break_down, ResetReason.FAULT)], ids=["hang", "fault"]
)
def test_what_goes_wrong_while_starting_starts_anew(
    board: BenchBoard, disturb: Callable[[BenchBoard], None], reason: ResetReason, after_us: float
) -> None:
    board.run(after_us)
    disturb(board)
    assert board.run_until(lambda: board.resets, 500_000)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        assert ring.hello.reset_reason == reason
    assert board.resets == 1


def test_after_the_watchdog_nothing_waits_for_the_crystal(board: BenchBoard, ring: LightRing) -> None:
    ring.set_leds(RED)
    board.run(2_000)
    hang(board)
    assert board.run_until(lambda: board.resets, 150_000)
    assert board.lit.any()
    board.run(4_000)
    assert not board.lit.any()
