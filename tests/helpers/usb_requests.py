"""Control transfers to an emulated board, on virtual time."""

from tests.helpers.bench_board import BenchBoard

GET_DEVICE, GET_CONFIGURATION = (0x80, 6, 0x100, 0, 18), (0x80, 6, 0x200, 0, 255)
SET_ADDRESS, SET_CONFIGURATION = (0x00, 5, 99, 0, 0), (0x00, 9, 1, 0, 0)
GET_INTERFACE, SET_INTERFACE = (0x81, 10, 0, 1, 1), (0x01, 11, 0, 1, 0)
SET_OTHER_SETTING = (0x01, 11, 1, 1, 0)
GET_LINE_CODING, LINE_CODING = (0xA1, 0x21, 0, 0, 7), b"\x00\xc2\x01\x00\x00\x00\x08"
"""115200 8N1, as the emulated host sets it when it opens the port"""
SEND_BREAK = (0x21, 0x23, 0xFFFF, 0, 0)
CLEAR_HALT_IN, CLEAR_HALT_OUT = (0x02, 1, 0, 0x82, 0), (0x02, 1, 0, 0x02, 0)
NOTIFY_IN, BULK_IN, BULK_OUT = 0x81, 0x82, 0x02
ADDRESS_REGISTER = 0x50110000
Request = tuple[int, int, int, int, int]


def halt(endpoint: int) -> Request:
    """SET_FEATURE(ENDPOINT_HALT)."""
    return (0x02, 3, 0, endpoint, 0)


def clear_halt(endpoint: int) -> Request:
    """CLEAR_FEATURE(ENDPOINT_HALT)."""
    return (0x02, 1, 0, endpoint, 0)


def status_of(endpoint: int) -> Request:
    """GET_STATUS, whose lowest bit says whether the endpoint is halted."""
    return (0x82, 0, 0, endpoint, 2)


def ask(board: BenchBoard, request: Request, data: bytes = b"", timeout_us: float = 100_000) -> bytes | None:
    """What came back, where the host sends `data` or nothing; None where the board stalled."""
    answers: list[bytes | None] = []
    board.host.control(*request, answers.append, data)
    assert board.run_until(lambda: answers, timeout_us), f"no answer to {request}"
    return answers[0]


def ask_after_abandoning(board: BenchBoard, abandoned: Request, request: Request) -> bytes | None:
    """Begin a transfer, cut it short while the board waits for the host to fetch its answer, and ask another."""
    board.host.latency_us = 2_000.0
    board.host.control(*abandoned, lambda _: None)
    board.run(500)
    board.host.abandon()
    answer = ask(board, request)
    board.host.latency_us = 0.0
    return answer
