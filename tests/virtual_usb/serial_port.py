"""The serial function of the device (CDC-ACM): passes bytes between the USB endpoints and the board's terminal.

The terminal is held open exactly while the host holds DTR up, so that the firmware notices a closed port.
"""

import contextlib
import os
import select
import struct
import threading
import time

from tests.helpers.usb_numbers import DTR, GET_LINE_CODING, SEND_BREAK, SET_CONTROL_LINE_STATE, SET_LINE_CODING
from tests.virtual_usb.cable import UsbCable
from tests.virtual_usb.descriptors import SERIAL_ENDPOINT

WAIT_S = 0.02


class SerialFunction:
    """Interfaces 0 and 1."""

    def __init__(self, path: str) -> None:
        """Connect to the terminal at `path`; "": there is none, bytes are lost."""
        self._path = path
        self._terminal: int | None = None
        self._lock = threading.Lock()
        self._line_coding = struct.pack("<IBBB", 115200, 0, 0, 8)

    def request(self, code: int, value: int, data: bytes) -> bytes | None:
        """Answer a class request to the communication interface; None: refused."""
        if code == SET_CONTROL_LINE_STATE:
            self._hold(bool(value & DTR))
        elif code == SET_LINE_CODING:
            self._line_coding = data
        elif code == GET_LINE_CODING:
            return self._line_coding
        elif code != SEND_BREAK:
            return None
        return b""

    def write(self, data: bytes) -> None:
        """Pass bytes of the host on; they are lost while DTR is down, as on a chip that waits for it."""
        with self._lock, contextlib.suppress(OSError):
            if self._terminal is not None:
                os.write(self._terminal, data)

    def run(self, cable: UsbCable) -> None:
        """Bring the board's bytes to the host until the cable is pulled."""
        while cable.plugged:
            data = self._read()
            if data:
                cable.send(SERIAL_ENDPOINT, data, wanted=lambda: cable.plugged, ended=False)

    def close(self) -> None:
        self._hold(False)

    def _hold(self, up: bool) -> None:
        with self._lock:
            if up and self._terminal is None and self._path:
                self._terminal = os.open(self._path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            elif not up and self._terminal is not None:
                os.close(self._terminal)
                self._terminal = None

    def _read(self) -> bytes:
        terminal = self._terminal
        if terminal is None:
            time.sleep(WAIT_S)
            return b""
        with contextlib.suppress(OSError, ValueError):
            if select.select([terminal], [], [], WAIT_S)[0]:
                with self._lock:  # another thread may have closed it, and its number may be another file's by now
                    return os.read(terminal, 512) if self._terminal == terminal else b""
        return b""
