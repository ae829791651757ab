"""A board that a check examines: what every check needs."""

import numpy as np

from gellight.ring.light_ring import LightRing
from tests.firmware.emulator.chip import VTOR
from tests.helpers.bench_board import BenchBoard, VirtualTransport

PATTERN = np.arange(36, dtype=np.uint8).reshape(12, 3) * 7 % 97


def dark(board: BenchBoard) -> bool:
    board.run(8_000)
    return not board.lit.any()


def reopen(board: BenchBoard) -> LightRing:
    board.run_until(lambda: board.host.configured, 200_000)
    return LightRing(VirtualTransport(board), keep_alive_s=None, timeout_s=0.03, attempts=2)


def break_down(board: BenchBoard) -> None:
    """Enter what the vector of HardFault points to."""
    board.chip.core.pc = board.chip.read_uint32(board.chip.read_uint32(VTOR) + 12) & ~1
    board.chip.core.waiting = False
