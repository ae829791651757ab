"""What keeps the LEDs lit while a program holds the ring open, and what happens when the program is held up."""

import logging
import time
from collections.abc import Callable

import pytest

from gellight.base.errors import BoardError
from gellight.ring.enumerations import State, SyncMode
from gellight.ring.light_ring import LightRing, Step
from tests.helpers.bench_board import RED, BenchBoard, VirtualTransport


def hold_up(board: BenchBoard, ring: LightRing) -> None:
    """Let the board hear nothing for more than a second of its time."""
    with ring._lock:
        board.run(1_200_000)
        assert not board.lit.any()


def trigger(board: BenchBoard, ring: LightRing) -> None:
    """Drive an edge to the trigger pin, once the board has had the time to wait for it."""
    with ring._lock:
        board.run(2_000)
        for high in (True, False):
            board.set_trigger(high)
            board.run(100)


def comes(board: BenchBoard, ring: LightRing, reached: Callable[[], bool]) -> bool:
    end = time.monotonic() + 10
    while time.monotonic() < end:
        with ring._lock:
            board.run(1_000)
            if reached():
                return True
        time.sleep(0.002)
    return False


def test_a_light_comes_back_after_the_program_was_held_up(board: BenchBoard, caplog: pytest.LogCaptureFixture) -> None:
    with LightRing(VirtualTransport(board), keep_alive_s=0.01) as ring:
        ring.set_leds(RED)
        hold_up(board, ring)
        assert comes(board, ring, lambda: bool((board.lit == RED).all()))
    assert "they are lit again" in caplog.text


def test_a_fault_of_who_listens_to_the_board_puts_no_light_out(
    board: BenchBoard, caplog: pytest.LogCaptureFixture
) -> None:
    with LightRing(VirtualTransport(board), keep_alive_s=0.01) as ring:
        ring.set_leds(RED)
        ring.ping_listeners.append(lambda _: 1 // 0)
        assert comes(board, ring, lambda: "ZeroDivisionError" in caplog.text)
        ring.ping_listeners.clear()
        hold_up(board, ring)
        assert comes(board, ring, lambda: bool((board.lit == RED).all()))


def test_darkness_that_was_asked_for_stays(board: BenchBoard, caplog: pytest.LogCaptureFixture) -> None:
    with LightRing(VirtualTransport(board), keep_alive_s=0.01) as ring:
        ring.load_sequence([RED], [Step(group=0, dwell_us=5_000)])
        ring.set_sync(SyncMode.FREE)
        ring.start()
        board_lit = lambda: bool(board.lit.any())  # noqa: E731
        assert comes(board, ring, board_lit)
        hold_up(board, ring)
        assert comes(board, ring, lambda: "a sequence that ran has ended" in caplog.text)
        assert not board_lit()


def test_a_sequence_that_misses_its_triggers_is_not_called_ended(
    board: BenchBoard, caplog: pytest.LogCaptureFixture
) -> None:
    with LightRing(VirtualTransport(board), keep_alive_s=0.01) as ring:
        ring.set_sync(SyncMode.EXT, timeout_us=50_000)
        ring.load_sequence([RED], [Step(group=0, dwell_us=0)])
        ring.start()
        trigger(board, ring)
        assert comes(board, ring, lambda: "its sequence goes on with the next light" in caplog.text)
        assert "made its LEDs dark (trigger missed)" in caplog.text
        assert "has ended" not in caplog.text
        assert ring.status().state == State.RUNNING
        trigger(board, ring)
        assert comes(board, ring, lambda: bool((board.lit == RED).all()))


def test_a_board_that_does_not_answer_for_a_while_is_asked_on(
    board: BenchBoard, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)

    class Busy(VirtualTransport):
        busy = False

        def write(self, data: bytes) -> None:
            if self.busy:
                raise BoardError("no answer")
            super().write(data)

    transport = Busy(board)
    with LightRing(transport, keep_alive_s=0.005) as ring:
        ring.set_leds(RED)
        transport.busy = True
        assert comes(board, ring, lambda: "does not answer" in caplog.text)
        hold_up(board, ring)
        transport.busy = False
        assert comes(board, ring, lambda: bool(board.lit.any()))
    assert caplog.text.count("does not answer") == 1
