"""An edge of the trigger at every instruction of a look at the timeout: it lights its step."""

import pytest

from gellight.ring.enumerations import SyncMode
from gellight.ring.light_ring import LightRing, Step
from tests.helpers.bench_board import RED, BenchBoard

pytestmark = pytest.mark.nightly
DELAY_US, EDGE_TOLERANCE_US = 300, 3.0


def step(board: BenchBoard, count: int = 1) -> None:
    for _ in range(count):
        board._run_slice(1e6, 1)


def light_up(board: BenchBoard) -> None:
    """A step is lit, and the next waits for its edge."""
    board.set_trigger(True)
    board.run(2_500)
    board.set_trigger(False)


def look(board: BenchBoard) -> bool:
    """Light a step and bring the board to its next look at the timeout; false if it went dark before."""
    light_up(board)
    for asleep in (True, False):
        while board.chip.core.waiting != asleep:
            step(board)
    return bool(board.lit.any())


def start(board: BenchBoard, ring: LightRing, timeout_us: int) -> None:
    ring.set_sync(SyncMode.EXT, delay_us=DELAY_US, timeout_us=timeout_us)
    ring.load_sequence([RED], [Step(group=0, dwell_us=0)])
    ring.start()
    board.run(3_000)


def instructions_of_a_look(board: BenchBoard) -> int:
    """How many the board executes from waking to sleeping."""
    count = 0
    while not board.chip.core.waiting:
        step(board)
        count += 1
    return count


def test_before_the_timeout_every_edge_lights_its_step(board: BenchBoard, ring: LightRing) -> None:
    start(board, ring, timeout_us=50_000)
    assert look(board)
    instructions = instructions_of_a_look(board)
    assert 100 < instructions < 1000
    for after in range(instructions):
        assert look(board)
        step(board, after)
        edge_us, before = board.now_us, len(board.waveform.frame_starts_us)
        light_up(board)
        assert len(board.waveform.frame_starts_us) == before + 1, after
        assert abs(board.waveform.frame_starts_us[-1] - edge_us - DELAY_US) < EDGE_TOLERANCE_US
        if after % 20 == 0:
            ring.clock()
    assert ring.counters().trigger_timeouts == 0
