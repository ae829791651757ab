"""``sim://?board=rp2040``: a board in a child process, as a stream of bytes and a timeline of light."""

import logging
import os
import select
import socket
import subprocess
import sys
import threading
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from gellight.base.errors import BoardError, first_line
from gellight.lab.core_board.built_board import check_buildable
from gellight.lab.core_board.light_timeline import Light, LightTimeline
from gellight.ring.wire import LED_COUNT
from tests.helpers.places import CHECKOUT

logger = logging.getLogger(__name__)
START_S = 30.0
STOP_S = 5.0
STANDSTILL_S = 10.0
"""emulation that gets no further for longer has hung"""
KEPT_POINTS = 4096


class Report(BaseModel):
    """One line that the process of the board prints; what it does not report is None."""

    now_us: float | None = None
    """how far virtual time had come"""
    at_s: float = 0.0
    """at this time of `time.monotonic`"""
    edge: bool = False
    """the trigger pin rose at `now_us`"""
    zero_s: float | None = None
    """virtual time would have begun then, had emulation never lagged; it moves where the lag grows too large"""
    ready_at: str | None = None
    """the board is ready; path of its terminal, "" where its bytes go through the socket"""
    light_us: float | None = None
    """virtual time at which the LEDs latched"""
    colours: str = ""
    """these colours, as 6 hexadecimal digits an LED"""
    faults: list[str] | None = None
    """what the firmware did wrong, at the end"""


class SimulatedBoard:
    """A transport to a simulated board, and what its LEDs show.

    `timeline` holds the colours that the LEDs latched, decoded from the data pin, on the board's virtual time in us.
    `virtual_us` converts a time of `time.monotonic`, so that a camera can ask what was lit during its exposure. Virtual
    time is where emulation has really come: it stands still while the machine is busy, and catches up. What is asked of
    the past is answered once emulation has got there, and the answer then never changes.
    """

    url = "sim://?board=rp2040"

    def __init__(self, *, pty: bool = False, unique_id: bytes | None = None, leds: int = LED_COUNT,
                 ring_c: float | None = None) -> None:  # fmt: skip
        """Start the board; with `pty` its bytes go through the terminal `path` instead of `read` and `write`.

        `unique_id` are the 8 bytes from which it makes its serial number; None: those of every simulated board.
        `leds` is the number that it is configured for; `ring_c`: its ring has an NTC of so many degrees Celsius, None:
        it has none. Raises BoardError where it does not start.
        """
        built = _built(leds, ring_c, unique_id)
        self.timeline = LightTimeline(leds)
        self.faults: list[str] = []
        self.path = ""
        self._passed: deque[tuple[float, float]] = deque([(time.monotonic(), 0.0)], KEPT_POINTS)
        """how far virtual time had come (us) at times of `time.monotonic` (s)"""
        self._zero_s = self.on_time_since_s = time.monotonic()
        """when virtual time would have begun, had emulation never lagged; since when that holds (`time.monotonic`)"""
        self._edges: list[float] = []
        """when the trigger pin rose, `time.monotonic`; the last one only"""
        self._started = False
        self._silent = False
        """whether the process says nothing more; its status does not show that while another thread waits for it"""
        self._ready = threading.Event()
        self._lock = threading.Condition()
        self._ours, theirs = socket.socketpair()
        how = ["--pty"] if pty else ["--socket", str(theirs.fileno())]
        how += built
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.firmware.emulator.process", *how],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            pass_fds=(theirs.fileno(),),
            env=os.environ | {"PYTHONPATH": os.pathsep.join([str(CHECKOUT), *sys.path])},
        )  # fmt: skip
        theirs.close()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        try:
            self._ready.wait(START_S)
        except BaseException:  # Ctrl-C
            self.close()
            raise
        if not self._started:
            self._process.kill()
            message = self._process.stderr.read() if self._process.stderr else ""
            self.close()
            raise BoardError(f"the simulated board does not start: {message.strip() or 'no answer'}")

    # ---- transport ----

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        try:
            self._ours.sendall(data)
        except OSError as error:
            raise BoardError(f"the simulated board is gone ({first_line(error)}): open sim:// again") from error

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, waiting for the first byte for `timeout_s` at most."""
        try:
            ready = select.select([self._ours], [], [], timeout_s)[0]
            data = self._ours.recv(4096) if ready else None
        except (OSError, ValueError) as error:
            raise BoardError(f"the simulated board is gone ({first_line(error)}): open sim:// again") from error
        if data == b"":
            raise BoardError("the simulated board has ended: open sim:// again")
        return data or b""

    def close(self) -> None:
        """End the process."""
        self._ours.close()
        if self.path and self._process.poll() is None:
            self._process.terminate()
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if threading.current_thread() is not self._listener:
            self._listener.join(STOP_S)
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe:
                pipe.close()
        if self.faults:
            logger.warning("the simulated board noticed faults of its firmware: %s", "; ".join(self.faults))

    @property
    def running(self) -> bool:
        """Whether the board is there; False once its process has ended, however that came.

        The process is not polled for it: a signal whose handler raises there would leave the lock of `Popen` taken,
        and `close` would wait for it for ever.
        """
        return not self._silent

    # ---- strobe ----

    def strobe(self) -> float:
        """Pulse the trigger pin, as a camera's strobe does, and return when (`time.monotonic`) it rose."""
        with self._lock:
            self._edges.clear()
        try:
            assert self._process.stdin is not None
            self._process.stdin.write("x")
            self._process.stdin.flush()
        except OSError as error:
            raise BoardError(f"the simulated board is gone ({first_line(error)}): open sim:// again") from error
        with self._lock:
            self._wait_for(lambda: bool(self._edges))
            if not self._edges:
                raise BoardError("the simulated board has ended: open sim:// again")
            return self._edges[0]

    # ---- light ----

    def virtual_us(self, monotonic_s: float) -> float:
        """Return the board's virtual time at a time of `time.monotonic`; BoardError if emulation hangs."""
        now_s = time.monotonic()
        with self._lock:
            self._wait_for(lambda: self._passed[-1][0] >= min(monotonic_s, now_s))
            after = bisect_right(self._passed, monotonic_s, key=lambda point: point[0])
            points = self._passed[max(after - 1, 0)], self._passed[min(after, len(self._passed) - 1)]
        (from_s, from_us), (to_s, to_us) = points
        rate = (to_us - from_us) / (to_s - from_s) if to_s > from_s else 1e6  # before and after all that is known
        return from_us + (monotonic_s - from_s) * rate

    def clock_us(self, monotonic_s: float) -> float:
        """Return the virtual time that it would be then, had emulation not lagged: never before `virtual_us`.

        A real board's light goes by this. It holds for times after `on_time_since_s`.
        """
        with self._lock:
            return (monotonic_s - self._zero_s) * 1e6

    def _wait_for(self, reached: Callable[[], bool]) -> None:
        if not self._lock.wait_for(lambda: reached() or self._silent, STANDSTILL_S):
            raise BoardError(
                f"the simulated board got no further for {STANDSTILL_S:g} s: the machine is busy, open sim:// anew"
            )

    def light_at(self, time_us: float) -> NDArray[np.uint8]:
        """Return the (n, 3) colours that were latched at a virtual time, as far as is known now."""
        with self._lock:
            return self.timeline.at(time_us)

    def light_during(self, start_us: float, end_us: float) -> list[Light]:
        """Return the light at the start of an interval of virtual time and every change in it, once it is over."""
        with self._lock:
            self._wait_for(lambda: self._passed[-1][1] >= end_us)
            return self.timeline.interval(start_us, end_us)

    def _listen(self) -> None:
        try:
            for line in self._process.stdout or ():
                with self._lock:
                    self._note(Report.model_validate_json(line))
                    self._lock.notify_all()
        finally:
            with self._lock:
                self._silent = True
                self._lock.notify_all()
            self._ready.set()

    def _note(self, report: Report) -> None:
        if report.now_us is not None:
            self._passed.append((report.at_s, report.now_us))
        if report.edge:
            self._edges.append(report.at_s)
        if report.zero_s is not None and report.zero_s != self._zero_s:
            self._zero_s, self.on_time_since_s = report.zero_s, report.at_s
        if report.ready_at is not None:
            self.path, self._started = report.ready_at, True
            self._ready.set()
        if report.light_us is not None:
            colours = np.frombuffer(bytes.fromhex(report.colours), np.uint8).reshape(-1, 3)
            self.timeline.append(Light(report.light_us, colours))
        if report.faults is not None:
            self.faults = report.faults


def _built(leds: int, ring_c: float | None, unique_id: bytes | None) -> list[str]:
    """Return how the process is told what its board has; BoardError for what no board has."""
    check_buildable(leds, ring_c)
    warm = [] if ring_c is None else [f"--ring-c={ring_c}"]
    return ["--leds", str(leds), *warm, *(["--unique-id", unique_id.hex()] if unique_id else [])]
