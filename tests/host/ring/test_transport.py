"""Ways to the board: the simulated one in its own process, a pseudo-terminal with real pyserial, the verbs."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.lab.emulator import child, process
from gellight.lab.emulator.child import SimulatedBoard
from gellight.lab.emulator.waveform import Light
from gellight.ring.light_ring import LightRing, Step, colour_bytes, connect
from gellight.ring.transport import SilentError, find_port, open_transport
from tests.helpers.command_line import invoke
from tests.helpers.waiting import eventually

RED = np.tile(np.array([200, 0, 0], np.uint8), (12, 1))


def is_lit(board: SimulatedBoard) -> bool:
    return bool(board.light_at(board.virtual_us(time.monotonic())).any())


@pytest.fixture(scope="module")
def terminal() -> Iterator[SimulatedBoard]:
    """A board behind a terminal; every test leaves it dark and without a fault."""
    board = SimulatedBoard(pty=True)
    yield board
    board.close()
    assert board.faults == []


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


def test_a_serial_port_that_takes_no_bytes_for_a_second_is_silent_not_gone() -> None:
    here, there = os.openpty()
    transport = open_transport(os.ttyname(there))
    try:
        with pytest.raises(SilentError, match="takes no bytes"):
            transport.write(bytes(1_000_000))
    finally:
        transport.close()
        os.close(there)
        os.close(here)


def test_sim_is_a_board_like_any_other() -> None:
    with connect("sim://") as ring:
        board = ring.transport
        assert isinstance(board, SimulatedBoard)
        events = []
        for colours in (RED, RED // 2):
            events.append(ring.wait_for_light(ring.set_leds(colours).light_id, timeout_s=5))
            eventually(lambda wanted=colours: np.array_equal(board.timeline[-1].colours, wanted))
        red, dim = events
        began_us = board.timeline[-2].time_us - red.latched_us
        assert 0 < began_us < 200_000, "the clock of the board begins while it starts"
        for event, before, after in ((red, 0 * RED, RED), (dim, RED, RED // 2)):
            shown = board.light_during(began_us + event.first_bit_us, began_us + event.latched_us + 30)
            np.testing.assert_array_equal(shown[0].colours, before)
            np.testing.assert_array_equal(shown[-1].colours, after)
            assert event.first_bit_us < shown[-1].time_us - began_us <= event.latched_us + 3
    assert not board.timeline[-1].colours.any()
    assert board.faults == []


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


def test_real_pyserial_reaches_it_through_a_terminal(terminal: SimulatedBoard) -> None:
    with connect(terminal.path) as ring:
        ring.set_leds(RED)
        eventually(lambda: is_lit(terminal))
    eventually(lambda: not is_lit(terminal))


def test_a_program_that_dies_leaves_the_leds_dark() -> None:
    board = SimulatedBoard(pty=True)
    child = os.fork()
    if child == 0:
        ring = connect(board.path)
        ring.set_leds(RED)
        time.sleep(60)
        os._exit(1)
    eventually(lambda: is_lit(board))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    eventually(lambda: not is_lit(board))
    board.close()
    assert board.faults == []


def test_the_ring_is_kept_alive_while_it_is_open(terminal: SimulatedBoard) -> None:
    with connect(terminal.path) as ring:
        ring.set_leds(RED)
        eventually(lambda: is_lit(terminal))
        start = terminal.virtual_us(time.monotonic())
        eventually(lambda: terminal.virtual_us(time.monotonic()) > start + 1_500_000)
        assert is_lit(terminal)
        assert ring.counters().dark_faults == 0


def test_a_board_that_ends_is_an_error() -> None:
    ring = connect("sim://")
    board = ring.transport
    assert isinstance(board, SimulatedBoard)
    board._process.kill()
    board._process.wait()
    with pytest.raises(BoardError, match="sim://"):
        ring.status()
    ring.close()


@pytest.mark.parametrize("url", ["", "ftp://board", "sim://7"])
def test_other_urls_are_refused(url: str) -> None:
    with pytest.raises(BoardError, match="names no board"):
        open_transport(url)


def test_a_port_that_is_not_there_is_a_remedy() -> None:
    with pytest.raises(BoardError, match="plug the light ring in"):
        open_transport("/dev/ttyNONE")
    with pytest.raises(BoardError, match="sim://"):
        find_port("0000")


def test_a_board_is_found_by_number_and_by_product_string(monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [
        SimpleNamespace(device="/dev/a", vid=0x1209, pid=1, serial_number="A1", product="GelLight light ring"),
        SimpleNamespace(device="/dev/b", vid=0x1234, pid=5, serial_number="B2", product="GelLight of the left hand"),
        SimpleNamespace(device="/dev/c", vid=0x2341, pid=0x43, serial_number="C3", product="Arduino"),
    ]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)
    assert find_port("A1") == find_port("GelLight light ring") == "/dev/a"
    assert find_port("B2") == find_port("GelLight of the left hand") == "/dev/b"
    with pytest.raises(BoardError, match=r"'C3' is connected .*A1 .GelLight light ring. at /dev/a, B2"):
        find_port("C3")
    with pytest.raises(BoardError, match="not exactly one board is connected"):
        find_port("")


def test_a_port_where_nobody_answers_is_an_error() -> None:
    class Silent:
        url = "silent"
        closed = False

        def write(self, data: bytes) -> None:
            """Swallow."""

        def read(self, timeout_s: float) -> bytes:
            return b""

        def close(self) -> None:
            self.closed = True

    transport = Silent()
    with pytest.raises(BoardError, match="did not answer HELLO in 3 attempts"):
        LightRing(transport, attempts=3)
    assert transport.closed


def test_colours_have_to_be_twelve_times_rgb() -> None:
    assert len(colour_bytes(RED, 12)) == 36
    with pytest.raises(ValueError, match=r"\(12, 3\) uint8"):
        colour_bytes(RED.astype(np.float32), 12)
    with pytest.raises(ValueError, match=r"\(12, 3\) uint8"):
        colour_bytes(RED[:11], 12)


# ---- the verbs ----


def test_the_verbs_drive_the_ring(terminal: SimulatedBoard) -> None:
    def run(*words: str) -> str:
        result = invoke("ring", *words, "--url", terminal.path)
        assert result.exit_code == 0, result.output + str(result.exception)
        return result.output

    assert "nothing wrong" in run("info")
    assert "lit, 58 mA" in run("set", "300000", "--seconds", "0.1")
    assert "[0, 1, 8]" in run("group", "0-1,8", "--seconds", "0.1")
    assert "0 of them late" in run("sequence", "--dwell-ms", "50", "--seconds", "0.5")
    assert "dark" in run("off")


def test_a_sequence_runs_in_wall_time(terminal: SimulatedBoard) -> None:
    with connect(terminal.path) as ring:
        from gellight.ring.enumerations import SyncMode

        before = len(terminal.timeline)
        ring.load_sequence([RED], [Step(group=0, dwell_us=100_000, blank_us=100_000)])
        ring.set_sync(SyncMode.FREE)
        ring.start()
        eventually(lambda: len(terminal.timeline) > before + 6)
