"""The life of the committed image on the bus: reset and cut short by its host."""

import pytest

from gellight.ring.light_ring import LightRing
from tests.helpers import usb_requests as usb
from tests.helpers.bench_board import RED, BenchBoard, VirtualTransport


def test_a_resume_opens_no_port_that_was_closed(board: BenchBoard, ring: LightRing) -> None:
    ring.close()
    board.suspend()
    board.run(5_000)
    board.resume()
    board.run(5_000)
    board.host.send(b"\x01\x01\0")
    board.run(5_000)
    assert not board.host.received


def test_what_does_not_fit_its_request_is_refused(board: BenchBoard, ring: LightRing) -> None:
    """Bytes that nobody takes, fewer than were told, an interface that is not there."""
    coding = (0x21, 0x20, 0, 0)
    refused = (
        ((*coding, 2), b"\x55\x66"), ((*coding, 0), b""), ((*coding, 8), bytes(8)), ((*coding, 7), bytes(3)),
        ((0x21, 0x22, 3, 0, 1), b"\0"), ((0x81, 0, 0, 2, 2), b""),
    )  # fmt: skip
    taken = (((0x81, 0, 0, 1, 2), b""), ((*coding, 7), b"\x80\x25\0\0\0\0\x08"))
    answers = []
    for request, data in refused + taken:
        answers.append(usb.ask(board, request, data))
        board.run(1_000)
        answers.append(usb.ask(board, usb.GET_LINE_CODING))
        board.run(1_000)
    assert answers[:-4] == [None, usb.LINE_CODING] * len(refused)
    assert answers[-4:] == [bytes(2), usb.LINE_CODING, b"", taken[1][1]]


@pytest.mark.parametrize("after_us", [20, 400, 700, 1_100])
def test_a_reset_in_mid_transfer_enumerates_anew(image: bytes, after_us: float) -> None:
    board = BenchBoard(image)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        ring.set_leds(RED)
        board.run(2_000)
        board.host.latency_us = 300.0
        board.host.control(*usb.GET_CONFIGURATION, lambda _: None)
        board.run(after_us)
        board.host.reset_bus()
        board.host.latency_us = 0.0
        assert board.run_until(lambda: board.host.configured, 200_000)
        board.run(3_000)
        assert not board.lit.any()
    with LightRing(VirtualTransport(board), keep_alive_s=None) as again:
        again.set_leds(RED)
        board.run(2_000)
        assert board.lit.any()
    assert board.faults == []
