"""`gellight sim`: a simulated board for any program that opens a serial port."""

import time
from typing import Annotated

import typer

from gellight.base.errors import BoardError
from gellight.cli.advice import with_program_path
from gellight.cli.ending import until_interrupted
from gellight.cli.options import LONGEST_S, Seconds
from gellight.lab.emulator.child import SimulatedBoard


def command(
    pty: Annotated[bool, typer.Option("--pty", help="Serve a pseudo-terminal (the default and only way).")] = True,
    seconds: Seconds = 0,
) -> None:
    """Run the firmware in a simulated board behind a pseudo-terminal.

    Its light is printed whenever it changes.
    """
    board = SimulatedBoard(pty=pty)
    try:
        with until_interrupted():
            show(board, seconds or LONGEST_S)
    finally:
        board.close()
    for fault in board.faults:
        print(f"fault: {fault}")


def show(board: SimulatedBoard, seconds: float) -> None:
    """Print the path of the board, then its light whenever it changes; BoardError where it ends before the time."""
    end, shown = time.monotonic() + seconds, 0
    print(
        with_program_path(f"a simulated board at {board.path}: try `gellight ring info --url {board.path}`"), flush=True
    )
    while time.monotonic() < end:
        while shown < len(board.timeline):
            light = board.timeline[shown]
            print(f"{light.time_us / 1e6:10.6f} s  " + " ".join(bytes(c).hex() for c in light.colours), flush=True)
            shown += 1
        if not board.running:
            raise BoardError("the simulated board has ended: start it again")
        time.sleep(0.02)
