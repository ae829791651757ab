"""Boards that were configured and have started anew."""

from dataclasses import replace

from gellight.ring.light_ring import LightRing
from tests.firmware.emulator.busy_bus import B2
from tests.firmware.emulator.waveform import Strip
from tests.helpers.bench_board import BenchBoard, VirtualTransport


def opened(board: BenchBoard) -> LightRing:
    return LightRing(VirtualTransport(board), keep_alive_s=None)


def wired(image: bytes, strip: Strip | None = None, *, revision: int = B2, **fields: int) -> BenchBoard:
    """A board that was configured so and has started anew; its LEDs may be others than before."""
    before = BenchBoard(image)
    ring = opened(before)
    ring.configure(replace(ring.configuration(), **fields), save=True)
    before.power_off()
    board = BenchBoard(bytes(before.flash), strip=strip, revision=revision)
    assert before.faults == []
    return board
