"""The USB boot loader of the RP2040 and the RP2350 (data sheets 2.8.5, 5.6: PICOBOOT) as a device for the real pyusb.

It is as strict as a flash chip: bytes are only written where they were erased, erasing goes by sectors of 4096 bytes,
writing by pages of 256, and nothing happens before exclusive access was taken and execute-in-place was left.
"""

import array
import struct
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import usb.backend
import usb.core

VENDOR, PRODUCT = 0x2E8A, 0x0003
MAGIC = 0x431FD10B
COMMAND = struct.Struct("<IIBBHI16s")
EXCLUSIVE, REBOOT, ERASE, WRITE, EXIT_XIP, REBOOT2, READ = 0x01, 0x02, 0x03, 0x05, 0x06, 0x0A, 0x84
SECTOR, PAGE = 4096, 256
FLASH_BASE = 0x10000000
OUT, IN = 0x03, 0x84
EPIPE, ETIMEDOUT = 32, 110
DEVICE = {"bLength": 18, "bDescriptorType": 1, "bcdUSB": 0x0110, "bDeviceClass": 0, "bDeviceSubClass": 0,
          "bDeviceProtocol": 0, "bMaxPacketSize0": 64, "idVendor": VENDOR, "bcdDevice": 0x0100, "iManufacturer": 1,
          "iProduct": 2, "iSerialNumber": 3, "bNumConfigurations": 1, "address": 7, "bus": 1, "port_number": 1,
          "port_numbers": (1,), "speed": 2}  # fmt: skip
CONFIGURATION = {"bLength": 9, "bDescriptorType": 2, "wTotalLength": 55, "bNumInterfaces": 2,
                 "bConfigurationValue": 1, "iConfiguration": 0, "bmAttributes": 0x80, "bMaxPower": 250}  # fmt: skip
INTERFACES = (((8, 6, 0x50), (0x81, 0x02)), ((0xFF, 0, 0), (OUT, IN)))
"""class, subclass and protocol of each, and the addresses of its bulk endpoints: a drive, and PICOBOOT"""
STRINGS = ("Raspberry Pi", "RP2 Boot", "E0C9125B0D9B")


def _described(**fields: Any) -> SimpleNamespace:
    return SimpleNamespace(**fields, extra_descriptors=[])


class BootRom(usb.backend.IBackend):  # type: ignore[misc]
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

    # ---- what pyusb asks of a bus with one device, which is configured already ----

    def enumerate_devices(self) -> Iterator[str]:
        yield "board"

    def get_device_descriptor(self, dev: str) -> Any:
        return _described(**DEVICE, idProduct=self._product)

    def get_configuration_descriptor(self, dev: str, config: int) -> Any:
        if config:
            raise IndexError(config)
        return _described(**CONFIGURATION)

    def get_interface_descriptor(self, dev: str, intf: int, alt: int, config: int) -> Any:
        """Return an interface; IndexError ends pyusb's search."""
        if alt or intf >= len(INTERFACES):
            raise IndexError(intf)
        names = ("bInterfaceClass", "bInterfaceSubClass", "bInterfaceProtocol")
        own = dict(zip(names, INTERFACES[intf][0], strict=True))
        return _described(**own, bLength=9, bDescriptorType=4, bInterfaceNumber=intf, bAlternateSetting=0,
                          bNumEndpoints=2, iInterface=0)  # fmt: skip

    def get_endpoint_descriptor(self, dev: str, ep: int, intf: int, alt: int, config: int) -> Any:
        return _described(bLength=7, bDescriptorType=5, bEndpointAddress=INTERFACES[intf][1][ep], bmAttributes=2,
                          wMaxPacketSize=64, bInterval=0, bRefresh=0, bSynchAddress=0)  # fmt: skip

    def open_device(self, dev: str) -> str:
        return dev

    def close_device(self, dev_handle: str) -> None:
        """Nothing to close."""

    def set_configuration(self, dev_handle: str, config_value: int) -> None:
        """It is configured already."""

    def get_configuration(self, dev_handle: str) -> int:
        return 1

    def claim_interface(self, dev_handle: str, intf: int) -> None:
        """No kernel driver competes."""

    def release_interface(self, dev_handle: str, intf: int) -> None:
        """No kernel driver waits."""

    def is_kernel_driver_active(self, dev_handle: str, intf: int) -> bool:
        return False

    def ctrl_transfer(self, dev_handle: str, bmRequestType: int, bRequest: int, wValue: int, wIndex: int,  # noqa: N803
                      data: Any, timeout: int) -> int:  # fmt: skip
        answer = self.control(bmRequestType, bRequest, wValue)[: len(data)]
        data[: len(answer)] = array.array("B", answer)
        return len(answer)

    def bulk_write(self, dev_handle: str, ep: int, intf: int, data: Any, timeout: int) -> int:
        self.send(ep, bytes(data))
        return len(data)

    def bulk_read(self, dev_handle: str, ep: int, intf: int, buff: Any, timeout: int) -> int:
        data = self.take(ep, len(buff))
        buff[: len(data)] = array.array("B", data)
        return len(data)

    # ---- what it is ----

    def control(self, kind: int, request: int, value: int) -> bytes:
        """Strings, interface reset and command status."""
        if (kind, request, value >> 8) == (0x80, 6, 3):
            text = STRINGS[(value & 0xFF) - 1].encode("utf-16le") if value & 0xFF else b"\x09\x04"
            return bytes([2 + len(text), 3]) + text
        if (kind, request) == (0x41, 0x41):
            self._incoming, self._answers = None, []
            return b""
        if (kind, request) == (0xC1, 0x42):
            return struct.pack("<IIBB6x", self._token, self._status, self._last, 0)
        raise usb.core.USBError("Pipe error", errno=EPIPE)

    def send(self, endpoint: int, data: bytes) -> None:
        """Take a command, the bytes of one, or the empty packet that ends a read."""
        if endpoint != OUT:
            raise usb.core.USBError("Pipe error", errno=EPIPE)
        if self._incoming is not None:
            self._take_bytes(data)
        elif data:
            self._command(data)

    def take(self, endpoint: int, most: int) -> bytes:
        """Give what a command returns, or the empty packet that ends it."""
        if endpoint != IN or not self._answers:
            raise usb.core.USBTimeoutError("Operation timed out", errno=ETIMEDOUT)
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


class NoDevice(BootRom):
    def enumerate_devices(self) -> Iterator[str]:
        return iter(())


def drive(folder: Path, board_id: str = "RPI-RP2") -> Path:
    """Make the drive that a boot loader shows."""
    folder.mkdir(parents=True)
    (folder / "INFO_UF2.TXT").write_text(f"UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: {board_id}\n")
    return folder
