"""`gellight sim`: a simulated board for any program that opens a serial port."""

from typing import Annotated

import typer

from gellight.cli.bounds import MOST_SECONDS, between


def command(
    pty: Annotated[bool, typer.Option("--pty", help="serve a pseudo-terminal (the default and only way)")] = True,
    seconds: Annotated[
        float, typer.Option(help="end after so long, s; 0: at Ctrl-C", callback=between(0, MOST_SECONDS, "s"))
    ] = 0,
) -> None:
    """Run the firmware in a simulated board behind a pseudo-terminal, and print its light."""
    import time

    from gellight.base.errors import BoardError
    from gellight.ring.emulator.child import SimulatedBoard

    board = SimulatedBoard(pty=pty)
    print(f"a simulated board at {board.path}: try `gellight ring info --url {board.path}`", flush=True)
    end, shown = time.monotonic() + (seconds or MOST_SECONDS), 0
    try:
        while time.monotonic() < end:
            while shown < len(board.timeline):
                light = board.timeline[shown]
                print(f"{light.time_us / 1e6:10.6f} s  " + " ".join(bytes(c).hex() for c in light.colours), flush=True)
                shown += 1
            if not board.running:
                raise BoardError("the simulated board has ended: start it again")
            time.sleep(0.02)
    except KeyboardInterrupt:
        print()
    finally:
        board.close()
    for fault in board.faults:
        print(f"fault: {fault}")
