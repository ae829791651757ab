"""A simulated board behind a pseudo-terminal, which real pyserial opens."""

import contextlib
import ctypes
import os
import select
import threading
import time

from gellight.base.errors import BoardError
from gellight.lab.core_board.core import FLASH_BYTES
from gellight.lab.core_board.simulated_board import UNIQUE_ID, SimulatedBoard
from gellight.ring.wire import LED_COUNT

CLOSED_S = 0.005
"""after which it is looked again whether a program has opened the terminal"""
STOP_S = 5.0


def cut_power(board: SimulatedBoard) -> None:
    """Let a board lose its power at once, as when somebody pulls the plug."""
    with board._lock:
        board._advance()
        board._end()


class TerminalBoard(SimulatedBoard):
    """A simulated board whose bytes go through the terminal `path`; its port is open while a program has that open."""

    def __init__(self, *, leds: int = LED_COUNT, unique_id: bytes = UNIQUE_ID) -> None:
        """Switch the board on, and serve it in a thread. Raises BoardError as a SimulatedBoard."""
        import tty

        super().__init__(leds=leds, unique_id=unique_id, opened=False)
        self._ours, theirs = os.openpty()
        tty.setraw(theirs)
        self.path = os.ttyname(theirs)
        os.close(theirs)
        os.set_blocking(self._ours, False)
        self._opened = False
        self._thread = threading.Thread(target=self._serve, name="simulated board", daemon=True)
        self._thread.start()

    def close(self) -> None:
        super().close()
        self._thread.join(STOP_S)

    def _restart(self) -> None:
        """Start anew, with what the flash keeps; the terminal stays, to the board it is opened once more."""
        self._opened = False
        self._past_us = self._now_us
        kept = ctypes.create_string_buffer(FLASH_BYTES)
        self._core.call("flash", kept)
        self._power_on(kept.raw, self._core.call("noted_saves"))

    def _serve(self) -> None:
        poll = select.poll()
        poll.register(self._ours, select.POLLIN)
        with contextlib.suppress(BoardError):  # it has ended
            while self.running:
                self._pass_on(dict(poll.poll(self.idle_s(time.monotonic()) * 1e3)).get(self._ours, 0))
        os.close(self._ours)

    def _pass_on(self, events: int) -> None:
        """Pass bytes on, both ways; what no program reads is lost."""
        if self._opened == bool(events & select.POLLHUP):
            self._opened = not self._opened
            self.link(self._opened)
        if events & select.POLLIN:
            self.write(os.read(self._ours, 4096))
        elif events:
            time.sleep(CLOSED_S)
        if data := self.read(0.0):
            with contextlib.suppress(OSError):
                os.write(self._ours, data)


def main() -> None:
    """Print the path of a board, then its light whenever it changes, until the process is ended."""
    board, shown = TerminalBoard(), 0
    print(board.path, flush=True)
    while True:
        lights = board.timeline
        while shown < len(lights):
            light = lights[shown]
            print(f"{light.time_us / 1e6:10.6f} s  {light.colours.tobytes().hex(' ', 3)}", flush=True)
            shown += 1
        time.sleep(0.01)


if __name__ == "__main__":
    main()
