"""The board by its bulk endpoints, through pyusb, without a serial port: what proves its USB to another driver."""

import logging
from typing import Any

from gellight.base.errors import BoardError, first_line
from gellight.ring import usb_numbers as numbers
from gellight.ring.transport import SilentError

logger = logging.getLogger(__name__)

USB_TIMEOUT_MS = 1000


class UsbTransport:
    """The bulk endpoints of the board, through pyusb."""

    def __init__(self, which: str, *, url: str, backend: Any = None) -> None:
        """Claim the data interface of the board and raise DTR; `backend` is pyusb's."""
        import usb.core
        import usb.util

        self.url = url
        self._usb = usb
        self._detached: list[int] = []
        """interfaces that a driver of the kernel had, and gets back"""
        devices = [device for device in usb.core.find(find_all=True, backend=backend) or [] if self._is_board(device)]
        try:
            chosen = [device for device in devices if not which or which in (device.serial_number, device.product)]
        except (usb.core.USBError, ValueError) as error:
            raise self._unusable(error) from error
        if len(chosen) != 1:
            raise BoardError(f"{len(chosen)} of {len(devices)} connected boards are {url}: check cable and number")
        self._device = chosen[0]
        try:
            self._claim()
        except usb.core.USBError as error:
            self._release()
            raise self._unusable(error) from error

    def _unusable(self, error: Exception) -> BoardError:
        return BoardError(f"cannot use {self.url} ({first_line(error)}): install the udev rule or use serial://")

    def _is_board(self, device: Any) -> bool:
        """Ask for its product string where the numbers do not tell; a device that may not be read is another one."""
        if numbers.is_board(device.idVendor, device.idProduct, None):
            return True
        try:
            return numbers.is_board(None, None, device.product)
        except (self._usb.core.USBError, ValueError):
            return False

    def _claim(self) -> None:
        for interface in (0, numbers.DATA_INTERFACE):
            if self._device.is_kernel_driver_active(interface):
                self._device.detach_kernel_driver(interface)
                self._detached.append(interface)
        self._usb.util.claim_interface(self._device, numbers.DATA_INTERFACE)
        self._lines(numbers.DTR_AND_RTS)

    def _release(self) -> None:
        """Let go of the board, and give the kernel's driver back what it had: the serial port is there again."""
        try:
            self._usb.util.release_interface(self._device, numbers.DATA_INTERFACE)
            for interface in self._detached:
                if not self._device.is_kernel_driver_active(interface):  # the first takes the other one too
                    self._device.attach_kernel_driver(interface)
        except self._usb.core.USBError as error:
            logger.debug("the kernel's driver was not attached again: %s", error)
        self._usb.util.dispose_resources(self._device)

    def _lines(self, state: int) -> None:
        self._device.ctrl_transfer(0x21, numbers.SET_CONTROL_LINE_STATE, state, 0, None, USB_TIMEOUT_MS)

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        try:
            self._device.write(numbers.OUT_ENDPOINT, data, USB_TIMEOUT_MS)
        except self._usb.core.USBError as error:
            kind = SilentError if isinstance(error, self._usb.core.USBTimeoutError) else BoardError
            raise kind(f"the board at {self.url} takes no bytes ({first_line(error)}): plug it in again") from error

    def read(self, timeout_s: float) -> bytes:
        """Take one USB packet."""
        try:
            return bytes(self._device.read(numbers.IN_ENDPOINT, 64, max(1, int(timeout_s * 1e3))))
        except self._usb.core.USBTimeoutError:
            return b""
        except self._usb.core.USBError as error:
            raise BoardError(f"the board at {self.url} is gone ({first_line(error)}): plug it in again") from error

    def close(self) -> None:
        """Drop DTR and let go of the board."""
        try:
            self._lines(0)
        except self._usb.core.USBError as error:
            logger.debug("the board went before it was closed: %s", error)
        self._release()
