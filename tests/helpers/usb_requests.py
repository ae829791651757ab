"""Control transfers to an emulated board, on virtual time."""

from tests.helpers.bench_board import BenchBoard

GET_DEVICE, GET_CONFIGURATION = (0x80, 6, 0x100, 0, 18), (0x80, 6, 0x200, 0, 255)
SET_ADDRESS = (0x00, 5, 99, 0, 0)
GET_INTERFACE, SET_INTERFACE = (0x81, 10, 0, 1, 1), (0x01, 11, 0, 1, 0)
SET_OTHER_SETTING = (0x01, 11, 1, 1, 0)
SEND_BREAK = (0x21, 0x23, 0xFFFF, 0, 0)
CLEAR_HALT_IN, CLEAR_HALT_OUT = (0x02, 1, 0, 0x82, 0), (0x02, 1, 0, 0x02, 0)
ADDRESS_REGISTER = 0x50110000
Request = tuple[int, int, int, int, int]


def ask(board: BenchBoard, request: Request, timeout_us: float = 100_000) -> bytes | None:
    """What came back; None where the board stalled."""
    answers: list[bytes | None] = []
    board.host.control(*request, answers.append)
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
