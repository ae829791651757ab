"""The emulated chip in a process of its own, behind the transport of `sim://?board=rp2040`."""

import os
import signal
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from gellight.lab.core_board.light_timeline import Light
from tests.firmware.emulator import child, process
from tests.firmware.emulator.child import SimulatedBoard
from tests.helpers.waiting import eventually

RED = np.tile(np.array([200, 0, 0], np.uint8), (12, 1))


def test_who_has_the_bytes_of_the_board_knows_its_light_and_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process of the board may stand still after it has sent them: frames taken then are of a later light."""
    told: list[child.Report] = []
    known: list[list[child.Report]] = []
    monkeypatch.setattr(process, "tell", told.append)
    host = SimpleNamespace(received=bytearray(), open=lambda: None, close=lambda: None)
    board = SimpleNamespace(now_us=0.0, timeline=[], host=host)
    stream = SimpleNamespace(connected=True, finished=False, read=lambda: b"")

    def run_until(_: object, duration_us: float) -> None:
        board.now_us += duration_us
        board.timeline.append(Light(board.now_us, RED))
        host.received += b"latched"

    def write(_: bytes) -> None:
        known.append(list(told))
        stream.finished = True

    board.run_until, stream.write = run_until, write
    nobody = SimpleNamespace(open=[], pass_on=lambda: None)
    process.serve(board, stream, nobody, time.monotonic())
    ((light, time_passed),) = known
    assert light.light_us == time_passed.now_us == board.now_us
    assert time_passed.at_s <= time.monotonic()


def test_the_clock_of_the_board_goes_on_while_its_process_stands_still() -> None:
    """A real board does not lag; where the emulated one lags too much, its clock is set back, and that is known."""
    board = SimulatedBoard()
    asked_s, passed_us, clock_us = clocks(board)
    assert passed_us <= clock_us + 10
    os.kill(board._process.pid, signal.SIGSTOP)
    time.sleep(0.4)
    goes_on_s = time.monotonic()
    os.kill(board._process.pid, signal.SIGCONT)
    eventually(lambda: board.on_time_since_s > goes_on_s)
    now_s, later_us, clock_us = clocks(board)
    assert later_us <= clock_us + 10
    assert clock_us < (now_s - asked_s - 0.3) * 1e6 + passed_us
    board.close()


def clocks(board: SimulatedBoard) -> tuple[float, float, float]:
    """Return a time, the virtual time and the board's clock then, and that it has not been set back in between."""
    while True:
        since_s, now_s = board.on_time_since_s, time.monotonic()
        passed_us, clock_us = board.virtual_us(now_s), board.clock_us(now_s)
        ahead_us = board.clock_us(now_s + 0.5)
        if board.on_time_since_s == since_s:
            assert ahead_us - clock_us == pytest.approx(0.5e6, abs=1)
            return now_s, passed_us, clock_us


def test_who_waits_for_the_light_of_a_board_that_ends_waits_no_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The end was missed where another thread waited for the process: pictures came 10 s after a brown-out."""
    monkeypatch.setattr(child, "STANDSTILL_S", 60.0)
    monkeypatch.setattr(SimulatedBoard, "running", True)  # as it seems while another thread waits for the process
    board = SimulatedBoard()
    waiting = threading.Thread(target=board.light_during, args=(0.0, 1e12), daemon=True)
    waiting.start()
    board.close()
    waiting.join(30)
    assert not waiting.is_alive()


def test_who_asks_whether_a_board_runs_takes_no_lock_of_its_process() -> None:
    """A signal whose handler raises while that lock is taken leaves it taken, and `close` waited for it for ever."""
    board = SimulatedBoard()
    board._process._waitpid_lock = None  # type: ignore[attr-defined]  # so `poll` would raise
    assert board.running
    board._process._waitpid_lock = threading.Lock()  # type: ignore[attr-defined]
    board._process.kill()
    eventually(lambda: not board.running)
    board.close()
