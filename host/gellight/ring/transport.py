"""Ways to the board of the light ring, chosen by URL; they all behave alike.

``/dev/ttyACM0`` or ``COM3``: that serial port. ``serial://WHICH``: the port of the board with this serial number or
product string, or ``serial://`` of the only one there is. ``sim://``: a simulated board, which runs the core of the
firmware; ``sim://?leds=8``: one that is configured for 8 LEDs; ``sim://?ring_c=70``: one whose ring has an NTC of 70
degrees.
"""

import errno
import re
from typing import TYPE_CHECKING, Protocol

from gellight.base.errors import INSTALL_UDEV, BoardError, first_line
from gellight.base.holders import holders_text
from gellight.ring.wire import LED_COUNT

if TYPE_CHECKING:
    from serial.tools.list_ports_common import ListPortInfo

SIMULATED = r"(leds=\d{1,2}|ring_c=-?\d{1,3}(\.\d+)?)"
"""what a simulated board is told"""
VENDOR, PRODUCT = 0x1209, 0x0001
"""by which the board is known on USB"""
NAME = "GelLight"
"""how the product string of every board begins, also of one that its maker gave a number of his own"""


class SilentError(BoardError):
    """The board did not answer, or took no bytes for a second: it may be back."""


class Transport(Protocol):
    """A stream of bytes in both directions."""

    url: str

    def write(self, data: bytes) -> None:
        """Send all bytes, or raise BoardError."""

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, waiting for the first byte `timeout_s` at most; b"" if nothing came."""

    def close(self) -> None:
        """Close; the board then darkens its LEDs."""


def open_transport(url: str) -> Transport:
    """Open the way that a URL names; BoardError if there is no board."""
    scheme, _, rest = url.partition("://")
    if scheme == "sim" and re.fullmatch(rf"(\?{SIMULATED}(&{SIMULATED})*)?", rest):
        from gellight.lab.core_board.simulated_board import SimulatedBoard

        told = dict(pair.split("=") for pair in rest[1:].split("&") if pair)
        ring_c = float(told["ring_c"]) if "ring_c" in told else None
        return SimulatedBoard(leds=int(told.get("leds", LED_COUNT)), ring_c=ring_c)
    if scheme == "serial" and rest != url:
        return SerialTransport(find_port(rest), url=url)
    if "://" not in url and url:
        return SerialTransport(url, url=url)
    raise BoardError(
        f"{url!r} names no board: give /dev/ttyACM0, serial://, serial://NUMBER, sim://, sim://?leds=8 or "
        "sim://?ring_c=70"
    )


def board_ports() -> "list[ListPortInfo]":
    """Return the serial ports of all boards that are plugged in."""
    from serial.tools import list_ports

    return [port for port in list_ports.comports() if is_board(port.vid, port.pid, port.product)]


def find_port(which: str) -> str:
    """Return the serial port of the board with this serial number or product string; of the only board for ""."""
    boards = board_ports()
    chosen = [port for port in boards if which in ("", port.serial_number, port.product)]
    if len(chosen) == 1:
        return str(chosen[0].device)
    found = ", ".join(f"{port.serial_number} ({port.product}) at {port.device}" for port in boards) or "none"
    what = f"not exactly one board with serial number or product string {which!r}" if which else "not exactly one board"
    raise BoardError(f"{what} is connected (found: {found}): check the cable, or try sim://")


class SerialTransport:
    """A serial port, through pyserial."""

    def __init__(self, port: str, *, url: str) -> None:
        """Open the port, which raises DTR."""
        import serial

        self.url, self._timeout = url, serial.SerialTimeoutException
        try:
            self._port = serial.Serial(port, 115200, timeout=0, write_timeout=1.0, exclusive=True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise BoardError(_why_closed(port, error)) from error

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        try:
            self._port.write(data)
        except OSError as error:  # SerialException is one
            kind = SilentError if isinstance(error, self._timeout) else BoardError
            raise kind(
                f"the board at {self.url} takes no bytes ({first_line(error)}): unplug it and plug it in"
            ) from error

    def read(self, timeout_s: float) -> bytes:
        """Wait for the first byte, then take what is there."""
        try:
            self._port.timeout = timeout_s
            first = bytes(self._port.read(1))
            return first + bytes(self._port.read(self._port.in_waiting)) if first else b""
        except OSError as error:
            raise BoardError(f"the board at {self.url} is gone ({first_line(error)}): plug it in again") from error

    def close(self) -> None:
        """Close the port, which drops DTR."""
        self._port.close()


def _why_closed(port: str, error: Exception) -> str:
    """Return why a port cannot be opened, and what to do; pyserial wraps the errno and the failed lock alike."""
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        return f"there is no {port}: plug the light ring in, or let `gellight find` list what is there"
    if number in (errno.EACCES, errno.EPERM):
        return f"you may not use {port}: run {INSTALL_UDEV}, then unplug the sensor and plug it in"
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in str(error):
        return f"{port} is in use by {holders_text(port)}: end that programme"
    return f"cannot open {port} ({error}): unplug the light ring and plug it in again"


def is_board(vendor: int | None, product: int | None, name: str | None) -> bool:
    """Whether a device with these numbers and this product string is a board of ours."""
    return (vendor, product) == (VENDOR, PRODUCT) or (name or "").startswith(NAME)
