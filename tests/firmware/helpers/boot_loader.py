"""The USB boot loader of the RP2040 and the RP2350 (data sheets 2.8.5, 5.6: PICOBOOT) as a device for pyusb.

It is as strict as a flash chip: bytes are only written where they were erased, erasing goes by sectors of 4096 bytes,
writing by pages of 256, and nothing happens before exclusive access was taken and execute-in-place was left.
"""

import struct

import usb.core

from tests.firmware.helpers.usb_backend import EPIPE, DeviceBackend

VENDOR, PRODUCT = 0x2E8A, 0x0003
MAGIC = 0x431FD10B
COMMAND = struct.Struct("<IIBBHI16s")
EXCLUSIVE, REBOOT, ERASE, WRITE, EXIT_XIP, REBOOT2, READ = 0x01, 0x02, 0x03, 0x05, 0x06, 0x0A, 0x84
SECTOR, PAGE = 4096, 256
FLASH_BASE = 0x10000000
OUT, IN = 0x03, 0x84
_DEVICE = struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0110, 0, 0, 0, 64, VENDOR, PRODUCT, 0x0100, 1, 2, 3, 1)
_INTERFACES = (
    struct.pack("<9B", 9, 4, 0, 0, 2, 8, 6, 0x50, 0)
    + struct.pack("<BBBBHB", 7, 5, 0x81, 2, 64, 0)
    + struct.pack("<BBBBHB", 7, 5, 0x02, 2, 64, 0)
    + struct.pack("<9B", 9, 4, 1, 0, 2, 0xFF, 0, 0, 0)
    + struct.pack("<BBBBHB", 7, 5, OUT, 2, 64, 0)
    + struct.pack("<BBBBHB", 7, 5, IN, 2, 64, 0)
)
_CONFIGURATION = struct.pack("<BBHBBBBB", 9, 2, 9 + len(_INTERFACES), 2, 1, 0, 0x80, 250) + _INTERFACES
_STRINGS = ("Raspberry Pi", "RP2 Boot", "E0C9125B0D9B")


class BootRom(DeviceBackend):
    """A chip in its boot loader; `flash` is what it holds, `rebooted` whether it was told to start it."""

    def __init__(self, flash: bytes = b"", *, size: int = 2 << 20, product: int = PRODUCT) -> None:
        """Hold this flash, erased beyond its end; `product` tells the chip."""
        super().__init__()
        self._product = product
        self.flash = bytearray(flash.ljust(size, b"\xff"))
        self.rebooted = False
        self._exclusive = self._xip_left = False
        self._token = self._status = self._last = 0
        self._incoming: tuple[int, int] | None = None
        self._written = bytearray()
        self._answers: list[bytes] = []

    def control(self, kind: int, request: int, value: int, index: int, length: int, data: bytes = b"") -> bytes:
        """Descriptors, interface reset and command status."""
        if (kind, request) == (0x80, 6):
            return self._descriptor(value >> 8, value & 0xFF)[:length]
        if (kind, request) == (0x41, 0x41):
            self._incoming, self._answers = None, []
            return b""
        if (kind, request) == (0xC1, 0x42):
            return struct.pack("<IIBB6x", self._token, self._status, self._last, 0)
        raise usb.core.USBError("Pipe error", errno=EPIPE)

    def _descriptor(self, kind: int, index: int) -> bytes:
        if kind == 1:
            return _DEVICE[:10] + struct.pack("<H", self._product) + _DEVICE[12:]
        if kind == 2:
            return _CONFIGURATION
        text = b"\x09\x04" if index == 0 else _STRINGS[index - 1].encode("utf-16le")
        return bytes([2 + len(text), 3]) + text

    def send(self, endpoint: int, data: bytes, timeout_us: float) -> None:
        """Take a command, the bytes of one, or the empty packet that ends a read."""
        if endpoint != OUT:
            raise usb.core.USBError("Pipe error", errno=EPIPE)
        if self._incoming is not None:
            self._take_bytes(data)
        elif data:
            self._command(data)

    def take(self, endpoint: int, most: int, timeout_us: float) -> bytes:
        """Give what a command returns, or the empty packet that ends it."""
        if endpoint != IN or not self._answers:
            raise usb.core.USBTimeoutError("Operation timed out", errno=110)
        answer = self._answers.pop(0)
        if len(answer) > most:
            self._answers.insert(0, answer[most:])
        return answer[:most]

    def _refuse(self, status: int) -> None:
        self._status = status
        raise usb.core.USBError("Pipe error", errno=EPIPE)

    def _command(self, data: bytes) -> None:
        if len(data) != COMMAND.size or struct.unpack_from("<I", data)[0] != MAGIC:
            self._refuse(2)
        _, self._token, self._last, _, _, length, arguments = COMMAND.unpack(data)
        self._status = 0
        address, count = struct.unpack_from("<II", arguments)
        if self._last == EXCLUSIVE:
            self._exclusive = bool(arguments[0])
        elif self._last == EXIT_XIP:
            self._xip_left = True
        elif self._last == (REBOOT if self._product == PRODUCT else REBOOT2):
            self.rebooted = True
        elif self._last in (ERASE, WRITE, READ):
            self._access(self._last, address - FLASH_BASE, count, length)
            return
        else:
            self._refuse(1)
        self._answers.append(b"")

    def _access(self, command: int, offset: int, count: int, length: int) -> None:
        unit = {ERASE: SECTOR, WRITE: PAGE, READ: 1}[command]
        if not self._exclusive or not self._xip_left:
            self._refuse(8)
        if offset < 0 or offset + count > len(self.flash):
            self._refuse(3)
        if offset % unit or count % unit or (command != ERASE and length != count):
            self._refuse(4)
        if command == ERASE:
            self.flash[offset : offset + count] = b"\xff" * count
            self._answers.append(b"")
        elif command == READ:
            self._answers.append(bytes(self.flash[offset : offset + count]))
        else:
            self._incoming, self._written = (offset, count), bytearray()

    def _take_bytes(self, data: bytes) -> None:
        offset, count = self._incoming or (0, 0)
        self._written += data
        if len(self._written) < count:
            return
        for i, value in enumerate(self._written[:count]):
            self.flash[offset + i] &= value  # programming only clears bits
        self._incoming = None
        self._answers.append(b"")
