"""`gellight simulate board`: a simulated board for any program that opens a serial port."""

import time

from gellight.cli.advice import with_program_path
from gellight.cli.ending import until_interrupted
from gellight.cli.options import LONGEST_S, Seconds
from gellight.lab.core_board.terminal import TerminalBoard


def command(seconds: Seconds = 0) -> None:
    """Run a simulated board behind a pseudo-terminal.

    It runs the core of the firmware. Its light is printed whenever it changes.
    """
    board = TerminalBoard()
    try:
        with until_interrupted():
            show(board, seconds or LONGEST_S)
    finally:
        board.close()


def show(board: TerminalBoard, seconds: float) -> None:
    """Print the path of the board, then its light whenever it changes."""
    end, shown = time.monotonic() + seconds, 0
    print(
        with_program_path(f"a simulated board at {board.path}: try `gellight ring info --url {board.path}`"), flush=True
    )
    while time.monotonic() < end:
        lights = board.timeline
        while shown < len(lights):
            light = lights[shown]
            print(f"{light.time_us / 1e6:10.6f} s  " + " ".join(bytes(c).hex() for c in light.colours), flush=True)
            shown += 1
        time.sleep(0.02)
