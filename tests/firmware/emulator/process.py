"""The simulated board in a process of its own, its virtual clock held to the wall clock.

Bytes of the serial port go through a socket that the parent hands over, or through a pseudo-terminal. On standard
output the process prints a `Report` a line: when it is ready, how far virtual time has come, what the LEDs latched.
"""

import argparse
import contextlib
import os
import select
import signal
import sys
import time
import tty

from gellight.ring.firmware.build import committed_image
from gellight.ring.wire import LED_COUNT
from tests.firmware.emulator.child import Report
from tests.firmware.emulator.chip import UNIQUE_ID, EmulatedBoard
from tests.firmware.emulator.configured import flash_of
from tests.firmware.emulator.waveform import Strip

SLICE_US = 2_000.0
MOST_LAG_US = 50_000.0
"""where emulation is slower than the wall clock, virtual time falls further behind for good"""
IDLE_S = 0.001
PROGRESS_US = 4_000.0
"""of virtual time, after which the parent is told of it"""
HEAT_KNOWN_US = 300_000.0
"""after which a board surely has measured its ring"""
STROBE_US = 500.0
"""as long a strobe is high"""


class Bytes:
    """A file descriptor for bytes both ways; `connected` stands for DTR."""

    def __init__(self, descriptor: int) -> None:
        """Serve a connected socket."""
        self.descriptor = descriptor
        self.connected = True
        self.finished = False

    def read(self) -> bytes:
        """Return what is there; the end of the stream drops DTR."""
        if not select.select([self.descriptor], [], [], 0)[0]:
            return b""
        data = self._take()
        self.connected = bool(data)
        self.finished = not data
        return data

    def _take(self) -> bytes:
        with contextlib.suppress(OSError):
            return os.read(self.descriptor, 4096)
        return b""

    def write(self, data: bytes) -> None:
        """Send; what the other end does not read is lost."""
        with contextlib.suppress(OSError):
            os.write(self.descriptor, data)


class StrobeWire:
    """A descriptor of which every byte is a strobe on the trigger pin."""

    def __init__(self, descriptor: int, board: EmulatedBoard) -> None:
        """Wire it to the board."""
        self.open, self._board = [descriptor], board
        """the descriptor, until its other end is closed"""

    def pass_on(self) -> None:
        """Pulse the pin if a byte has come, and tell the parent when the edge was."""
        if not select.select(self.open, [], [], 0)[0]:
            return
        if not os.read(self.open[0], 1):
            self.open.clear()
            return
        self._board.set_trigger(True)
        tell(Report(now_us=self._board.now_us, at_s=time.monotonic(), edge=True))
        self._board.run_until(lambda: False, STROBE_US)
        self._board.set_trigger(False)


class PseudoTerminal(Bytes):
    """A terminal that real pyserial opens; DTR is up while a program holds it open."""

    def __init__(self) -> None:
        """Make the pair of terminals; ours stays open."""
        controlling, subordinate = os.openpty()
        tty.setraw(subordinate)
        self.path = os.ttyname(subordinate)
        os.close(subordinate)
        os.set_blocking(controlling, False)
        super().__init__(controlling)
        self.connected = False
        self._poll = select.poll()
        self._poll.register(controlling, select.POLLIN)

    def read(self) -> bytes:
        """Return what is there; a hang-up means that no program has it open."""
        events = dict(self._poll.poll(0)).get(self.descriptor, 0)
        self.connected = not events & select.POLLHUP
        return self._take() if events & select.POLLIN else b""


def tell(report: Report) -> None:
    """Print one line for the parent, in one piece: a signal may end the process at any moment."""
    print(report.model_dump_json(exclude_none=True) + "\n", end="", flush=True)


def serve(board: EmulatedBoard, stream: Bytes, strobe: StrobeWire, zero_s: float) -> None:
    """Run until the stream ends; `zero_s` on `time.monotonic` is when virtual time began."""
    told, opened, progress_us = 0, False, 0.0
    while not stream.finished:
        data = stream.read()
        if stream.connected != opened:
            opened = stream.connected
            (board.host.open if opened else board.host.close)()
        if data:
            board.host.send(data)
        strobe.pass_on()
        due_us = (time.monotonic() - zero_s) * 1e6 - board.now_us
        if due_us > MOST_LAG_US:
            zero_s, due_us = zero_s + (due_us - MOST_LAG_US) / 1e6, MOST_LAG_US
        if due_us > 0:
            board.run_until(lambda: board.host.received, min(due_us, SLICE_US))
        while told < len(board.timeline):
            light = board.timeline[told]
            tell(Report(light_us=light.time_us, colours=light.colours.tobytes().hex()))
            told += 1
        # Before the bytes: whoever has them may ask for light from then on, and this process may stand still meanwhile.
        if board.host.received or board.now_us - progress_us >= PROGRESS_US:
            progress_us = board.now_us
            tell(Report(now_us=progress_us, at_s=time.monotonic(), zero_s=zero_s))
        if board.host.received:
            stream.write(bytes(board.host.received))
            board.host.received.clear()
        elif due_us < SLICE_US:
            select.select([*strobe.open, *([stream.descriptor] if opened else [])], [], [], IDLE_S)


def main(arguments: list[str] | None = None) -> None:
    """Run a board: `--socket N` serves an inherited socket, `--pty` makes a terminal."""
    parser = argparse.ArgumentParser(prog="python -m tests.firmware.emulator.process", description=__doc__)
    parser.add_argument("--socket", type=int, help="number of the file descriptor of a connected socket")
    parser.add_argument("--pty", action="store_true", help="make a pseudo-terminal and print its name")
    parser.add_argument("--unique-id", type=bytes.fromhex, default=UNIQUE_ID, help="16 hexadecimal digits")
    parser.add_argument("--leds", type=int, default=LED_COUNT, help="number of LEDs that it is configured for")
    parser.add_argument("--ring-c", type=float, help="temperature of the ring's NTC; without it the ring has none")
    chosen = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the terminal: the parent still has to make the LEDs dark
    board = EmulatedBoard(
        flash_of(committed_image(), chosen.leds), unique_id=chosen.unique_id, strip=Strip(chosen.leds)
    )
    if chosen.ring_c is not None:
        board.set_ring_temperature(chosen.ring_c)
    if not board.run_until(lambda: board.host.configured, 200_000):
        sys.exit(f"the firmware did not enumerate: {board.faults}")
    if chosen.ring_c is not None:
        board.run(HEAT_KNOWN_US)
    stream = PseudoTerminal() if chosen.pty or chosen.socket is None else Bytes(chosen.socket)
    path = stream.path if isinstance(stream, PseudoTerminal) else ""
    now_s = time.monotonic()
    zero_s = now_s - board.now_us / 1e6
    tell(Report(now_us=board.now_us, at_s=now_s, zero_s=zero_s, ready_at=path))
    try:
        serve(board, stream, StrobeWire(sys.stdin.fileno(), board), zero_s)
    finally:
        tell(Report(faults=board.faults))


if __name__ == "__main__":
    main()
