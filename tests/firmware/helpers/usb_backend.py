"""A pyusb backend onto the emulated board, so that the real pyusb runs unchanged without hardware."""

import array
from abc import abstractmethod
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import usb.backend
import usb.core

from tests.firmware.emulator.usb_host import ADDRESS
from tests.helpers.bench_board import BenchBoard

CONTROL_US = 200_000.0
EPIPE, ETIMEDOUT = 32, 110
INTERFACE, ENDPOINT = 4, 5


def _fields(names: str, values: tuple[int, ...]) -> Any:
    return SimpleNamespace(**dict(zip(names.split(), values, strict=True)), extra_descriptors=[])


class DeviceBackend(usb.backend.IBackend):  # type: ignore[misc]
    """One bus with one device that is configured already; what it is, its descriptors tell."""

    @abstractmethod
    def control(self, kind: int, request: int, value: int, index: int, length: int, data: bytes = b"") -> bytes:
        """Do a control transfer and return what came back."""

    @abstractmethod
    def send(self, endpoint: int, data: bytes, timeout_us: float) -> None:
        """Send bytes to a bulk endpoint."""

    @abstractmethod
    def take(self, endpoint: int, most: int, timeout_us: float) -> bytes:
        """Return what a bulk endpoint has, at most that many bytes."""

    def enumerate_devices(self) -> Iterator[str]:
        """Yield the one device."""
        yield "board"

    def get_device_descriptor(self, dev: str) -> Any:
        """Read the device descriptor from the firmware."""
        raw = self.control(0x80, 6, 0x100, 0, 18)
        pairs = {2: "bcdUSB", 8: "idVendor", 10: "idProduct", 12: "bcdDevice"}
        single = {0: "bLength", 1: "bDescriptorType", 4: "bDeviceClass", 5: "bDeviceSubClass", 6: "bDeviceProtocol",
                  7: "bMaxPacketSize0", 14: "iManufacturer", 15: "iProduct", 16: "iSerialNumber",
                  17: "bNumConfigurations"}  # fmt: skip
        values = {name: raw[at] for at, name in single.items()}
        values |= {name: int.from_bytes(raw[at : at + 2], "little") for at, name in pairs.items()}
        return SimpleNamespace(**values, address=ADDRESS, bus=1, port_number=1, port_numbers=(1,), speed=2)

    def get_configuration_descriptor(self, dev: str, config: int) -> Any:
        """Read the head of the configuration."""
        if config:
            raise IndexError(config)
        raw = self._configuration()
        names = (
            "bLength bDescriptorType wTotalLength bNumInterfaces "
            "bConfigurationValue iConfiguration bmAttributes bMaxPower"
        )
        return _fields(names, (raw[0], raw[1], int.from_bytes(raw[2:4], "little"), *raw[4:9]))

    def _configuration(self) -> bytes:
        return self.control(0x80, 6, 0x200, 0, 255)

    def _descriptors(self, kind: int) -> list[tuple[int, bytes]]:
        """Interface number and bytes of each descriptor of a kind."""
        rest, interface, found = self._configuration(), -1, []
        while rest:
            if rest[1] == INTERFACE:
                interface = rest[2]
            if rest[1] == kind:
                found.append((interface, rest[: rest[0]]))
            rest = rest[rest[0] :]
        return found

    def get_interface_descriptor(self, dev: str, intf: int, alt: int, config: int) -> Any:
        """Return an interface; IndexError ends pyusb's search."""
        found = self._descriptors(INTERFACE)
        if alt or intf >= len(found):
            raise IndexError(intf)
        names = (
            "bLength bDescriptorType bInterfaceNumber bAlternateSetting bNumEndpoints "
            "bInterfaceClass bInterfaceSubClass bInterfaceProtocol iInterface"
        )
        return _fields(names, tuple(found[intf][1][:9]))

    def get_endpoint_descriptor(self, dev: str, ep: int, intf: int, alt: int, config: int) -> Any:
        """Return an endpoint of an interface."""
        raw = [raw for interface, raw in self._descriptors(ENDPOINT) if interface == intf][ep]
        names = "bLength bDescriptorType bEndpointAddress bmAttributes wMaxPacketSize bInterval bRefresh bSynchAddress"
        return _fields(names, (*raw[:4], int.from_bytes(raw[4:6], "little"), raw[6], 0, 0))

    def open_device(self, dev: str) -> str:
        """Return the device as its own handle."""
        return dev

    def close_device(self, dev_handle: str) -> None:
        """Nothing to close."""

    def set_configuration(self, dev_handle: str, config_value: int) -> None:
        """It is configured already."""

    def get_configuration(self, dev_handle: str) -> int:
        """Return the only configuration."""
        return 1

    def claim_interface(self, dev_handle: str, intf: int) -> None:
        """No kernel driver competes."""

    def release_interface(self, dev_handle: str, intf: int) -> None:
        """No kernel driver waits."""

    def is_kernel_driver_active(self, dev_handle: str, intf: int) -> bool:
        """No kernel driver."""
        return False

    def ctrl_transfer(self, dev_handle: str, bmRequestType: int, bRequest: int, wValue: int, wIndex: int,  # noqa: N803
                      data: Any, timeout: int) -> int:  # fmt: skip
        """Do a control transfer."""
        if bmRequestType & 0x80:
            answer = self.control(bmRequestType, bRequest, wValue, wIndex, len(data))
            data[: len(answer)] = array.array("B", answer)
            return len(answer)
        self.control(bmRequestType, bRequest, wValue, wIndex, len(data), bytes(data))
        return len(data)

    def bulk_write(self, dev_handle: str, ep: int, intf: int, data: Any, timeout: int) -> int:
        """Send bytes and wait until the device has them."""
        self.send(ep, bytes(data), timeout * 1e3)
        return len(data)

    def bulk_read(self, dev_handle: str, ep: int, intf: int, buff: Any, timeout: int) -> int:
        """Take what the device sent."""
        data = self.take(ep, len(buff), timeout * 1e3)
        buff[: len(data)] = array.array("B", data)
        return len(data)


class EmulatedBackend(DeviceBackend):
    """The firmware on the emulated board; waiting for it lets virtual time pass."""

    def __init__(self, board: BenchBoard) -> None:
        """Enumerate the board when it is first looked for."""
        super().__init__()
        self.board = board

    def _wait(self, reached: Callable[[], object], timeout_us: float) -> None:
        if not self.board.run_until(reached, timeout_us):
            raise usb.core.USBTimeoutError("Operation timed out", errno=ETIMEDOUT)

    def enumerate_devices(self) -> Iterator[str]:
        """Yield the board once it is on the bus."""
        self._wait(lambda: self.board.host.configured, CONTROL_US)
        yield "board"

    def control(self, kind: int, request: int, value: int, index: int, length: int, data: bytes = b"") -> bytes:
        """Let the firmware answer; a stall is EPIPE."""
        answers: list[bytes | None] = []
        self.board.host.control(kind, request, value, index, length, answers.append, data)
        self._wait(lambda: answers, CONTROL_US)
        if answers[0] is None:
            raise usb.core.USBError("Pipe error", errno=EPIPE)
        return answers[0]

    def send(self, endpoint: int, data: bytes, timeout_us: float) -> None:
        """Wait until the device has taken the bytes."""
        self.board.host.send(data)
        self._wait(lambda: not self.board.host.unsent, timeout_us)

    def take(self, endpoint: int, most: int, timeout_us: float) -> bytes:
        """Wait for bytes."""
        received = self.board.host.received
        self._wait(lambda: received, timeout_us)
        data = bytes(received[:most])
        del received[:most]
        return data
