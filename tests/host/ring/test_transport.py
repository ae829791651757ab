"""Ways to the board: the simulated one, a pseudo-terminal with real pyserial, the verbs."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.lab.core_board.simulated_board import SimulatedBoard
from gellight.ring.enumerations import Edge, SyncMode
from gellight.ring.light_ring import LightRing, Step, colour_bytes, connect
from gellight.ring.transport import SilentError, find_port, open_transport
from tests.helpers.terminal_board import TerminalBoard, cut_power
from tests.helpers.waiting import eventually

RED = np.tile(np.array([200, 0, 0], np.uint8), (12, 1))


def is_lit(board: SimulatedBoard) -> bool:
    return bool(board.light_at(board.virtual_us(time.monotonic())).any())


@pytest.fixture(scope="module")
def terminal() -> Iterator[TerminalBoard]:
    """A board behind a terminal; every test leaves it dark."""
    board = TerminalBoard()
    yield board
    board.close()


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
        events = []
        for colours in (RED, RED // 2):
            events.append(ring.wait_for_light(ring.set_leds(colours).light_id, timeout_s=5))
            eventually(lambda wanted=colours: np.array_equal(board.timeline[-1].colours, wanted))
        red, dim = events
        began_us = board.timeline[-2].time_us - red.latched_us
        assert -1 < began_us < 1
        for event, before, after in ((red, 0 * RED, RED), (dim, RED, RED // 2)):
            shown = board.light_during(began_us + event.first_bit_us, began_us + event.latched_us + 30)
            np.testing.assert_array_equal(shown[0].colours, before)
            np.testing.assert_array_equal(shown[-1].colours, after)
            assert event.first_bit_us < shown[-1].time_us - began_us <= event.latched_us + 3
    assert not board.timeline[-1].colours.any()


def test_who_waits_for_the_light_of_a_board_that_ends_waits_no_longer() -> None:
    board = SimulatedBoard()
    waiting = threading.Thread(target=board.light_during, args=(0.0, 60e6), daemon=True)
    waiting.start()
    board.close()
    waiting.join(10)
    assert not waiting.is_alive()


def test_a_strobe_is_an_edge_that_rises_and_one_that_falls() -> None:
    with connect("sim://") as ring:
        board = ring.transport
        for edge, after_us in ((Edge.RISING, 0), (Edge.FALLING, 500)):
            ring.set_sync(SyncMode.EXT, edge=edge)
            ring.load_sequence([RED, RED // 2], [Step(group=0, dwell_us=0), Step(group=1, dwell_us=0)])
            ring.start()
            risen_us = board.virtual_us(board.strobe())
            eventually(lambda: board.timeline.shining)
            event = ring.wait_for_light(ring.status().light_id)
            assert event.first_bit_us == pytest.approx(risen_us + after_us, abs=1)
            ring.blank()
            eventually(lambda: not board.timeline.shining)


def test_a_board_that_starts_anew_is_gone_for_its_host_and_keeps_its_flash(terminal: TerminalBoard) -> None:
    with connect("sim://") as ring:
        ring.reset()
        eventually(lambda: not ring.transport.running)
        with pytest.raises(BoardError, match="has ended"):
            ring.status()
    with connect(terminal.path) as ring:
        ring.configure(replace(ring.configuration(), name=b"anew".ljust(16, b"\0")), save=True)
        eventually(lambda: ring.status().time_us > 300_000)
        _, latest_us = started_us(ring)
        ring.reset()
        eventually(lambda: started_us(ring)[0] > latest_us)
        assert ring.configuration().name.rstrip(b"\0") == b"anew"


def started_us(ring: LightRing) -> tuple[float, float]:
    """Return between which times of this computer the clock of a board began."""
    asked_us = time.monotonic() * 1e6
    told_us = ring.status().time_us
    return asked_us - told_us, time.monotonic() * 1e6 - told_us


def test_real_pyserial_reaches_it_and_keeps_the_ring_alive_while_it_is_open(terminal: TerminalBoard) -> None:
    with connect(terminal.path) as ring:
        ring.set_leds(RED)
        eventually(lambda: is_lit(terminal))
    eventually(lambda: not is_lit(terminal))
    with connect(terminal.path) as ring:
        ring.set_leds(RED)
        eventually(lambda: is_lit(terminal))
        start = terminal.virtual_us(time.monotonic())
        eventually(lambda: terminal.virtual_us(time.monotonic()) > start + 1_500_000)
        assert is_lit(terminal)
        assert ring.counters().dark_faults == 0


def test_a_program_that_dies_leaves_the_leds_dark() -> None:
    board = TerminalBoard()
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


def test_a_board_that_ends_is_an_error() -> None:
    ring = connect("sim://")
    ring.light(RED)
    board = ring.transport
    cut_power(board)
    assert not board.timeline[-1].colours.any()
    with pytest.raises(BoardError, match="sim://"):
        ring.status()
    ring.close()


@pytest.mark.parametrize("url", ["", "ftp://board", "sim://7"])
def test_other_urls_are_refused(url: str) -> None:
    with pytest.raises(BoardError, match="names no board"):
        open_transport(url)


def test_a_port_that_is_not_there_is_a_remedy() -> None:
    with pytest.raises(BoardError, match="there is no /dev/ttyNONE: plug the light ring in"):
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
