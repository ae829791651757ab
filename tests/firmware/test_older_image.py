"""The emulated board refuses the image of protocol 1.1, which broke rules that most boards on a desk forgive.

`images/firmware-1.1.bin` is that image. Today's image keeps each of these rules (test_mutants.py).
"""

from pathlib import Path

import pytest

from gellight.ring import protocol as p
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator.usb_host import ADDRESS
from tests.helpers import usb_requests as usb
from tests.helpers.bench_board import BenchBoard

IMAGE = Path(__file__).parent / "images/firmware-1.1.bin"
CLOCK = p.COMMANDS["CLOCK"].code


def running() -> BenchBoard:
    board = BenchBoard(IMAGE.read_bytes())
    assert board.run_until(lambda: board.host.configured, 200_000)
    board.host.open()
    board.run(3_000)
    return board


@pytest.fixture(scope="module")
def faults() -> str:
    board = running()
    for number in range(40):
        board.host.send(encode(Packet(CLOCK, number, bytes(8))))
        board.run(777)
    return "\n".join(board.faults)


@pytest.mark.parametrize(
    "rule",
    [
        "the crystal is used before it has settled",
        "PLL_USB: its oscillator runs at 480 MHz, not 750 to 1600 MHz",
        "clk_sys is 48 MHz, below 1.1 times clk_usb (erratum RP2040-E16)",
        "the clock is raised before the watchdog runs",
        "the clock is raised while the vector of HardFault holds",
        "(erratum RP2040-E15)",
    ],
)
def test_a_broken_rule_of_the_chip_is_told(faults: str, rule: str) -> None:
    assert rule in faults


@pytest.mark.parametrize("request_", [usb.GET_INTERFACE, usb.SEND_BREAK])
def test_a_request_that_it_refused_is_noticed(request_: usb.Request) -> None:
    assert usb.ask(running(), request_) is None


def answers(board: BenchBoard) -> int:
    """How many of three requests are answered."""
    board.host.received.clear()
    for number in range(3):
        board.host.send(encode(Packet(CLOCK, 100 + number, bytes(8))))
        board.run(5_000)
    return board.host.received.count(0)


def test_after_a_suspend_it_answered_no_more() -> None:
    board = running()
    assert answers(board) == 3
    board.suspend()
    board.run(5_000)
    board.resume()
    assert answers(board) == 0


def test_after_a_cleared_halt_its_toggle_was_wrong() -> None:
    board = running()
    board.host.send(encode(Packet(CLOCK, 7, bytes(8))))
    board.run(5_000)
    before = len(board.faults)
    usb.ask(board, usb.CLEAR_HALT_IN)
    answers(board)
    assert any("wrong data toggle" in fault for fault in board.faults[before:])


def test_an_address_that_was_taken_back_was_kept() -> None:
    board = running()
    usb.ask_after_abandoning(board, usb.SET_ADDRESS, usb.GET_DEVICE)
    assert board.chip.read_uint32(usb.ADDRESS_REGISTER) != ADDRESS
