"""The host's end of the USB cable: enumerates like Linux, speaks to the CDC-ACM interface, checks every data toggle."""

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from tests.firmware.emulator.usb_rules import AVAILABLE, DATA1, STALL, BufferRules, endpoint_kinds, is_descriptor
from tests.helpers import usb_numbers as numbers

SET_INTERFACE = 11
ENDPOINT0_BYTES, ENDPOINTS = 64, 16
BULK_BYTES, READ_BYTES = 64, 128
"""of a packet, and of one read of Linux' cdc_acm, which a shorter packet ends"""
FRAME_NS, HANGS_NS = 1e6, (800e3, 998e3)
"""after the start of a frame no bulk IN may be armed in this time (erratum RP2040-E15)"""
SIE_CTRL, PULL_UP = 0x4C, 1 << 16
ADDRESS = 127
"""the highest (USB 2.0, 9.4.6)"""
RECOVERY_NS, SETTLING_NS = 10e6, 2e6
"""which a device has after a reset (USB 2.0, 7.1.7.5), and after SET_ADDRESS (9.2.6.3)"""


@dataclass
class Transfer:
    """A control transfer; `done` gets what came back, or None if the device stalled."""

    setup: bytes
    data: bytes
    done: Callable[[bytes | None], None]
    stage: str = ""
    received: bytearray = field(default_factory=bytearray)

    @property
    def reads(self) -> bool:
        """Data goes from the device to the host."""
        return bool(self.setup[0] & 0x80)

    @property
    def length(self) -> int:
        """Bytes that the host asks for or sends."""
        return int.from_bytes(self.setup[6:8], "little")


class UsbHost:
    """Drives the emulated controller by its callbacks; nothing happens unless virtual time passes."""

    def __init__(self, controller: Any, report: Callable[[str], None], clocked: Callable[[], bool]) -> None:
        """Wait for the device's pull-up, then enumerate."""
        self._usb, self._report, self._clocked = controller, report, clocked
        self._queue: deque[Transfer] = deque()
        self._current: Transfer | None = None
        self.latency_us = 0.0
        """how long it takes until the host fetches what the device has armed"""
        self.hangs = False
        """the controller answers nothing any more until it is reset (erratum RP2040-E15)"""
        self._read = bytearray()
        self._toggles: dict[int, int] = {}
        """of the IN endpoints"""
        self._out_toggle, self._out_data1 = 0, False
        """of the bulk OUT endpoint: what the host sends next, and what the device expects"""
        self._fetches = [controller.rp2040.clock.create_alarm(partial(self._fetch, k)) for k in range(ENDPOINTS)]
        self._recovery = controller.rp2040.clock.create_alarm(self.enumerate)
        self._address = 0
        """at which the host speaks to the device"""
        self._settling = controller.rp2040.clock.create_alarm(self._settled)
        self._settles = False
        self._status_armed = False
        self._out_room = 0
        self.stalled: set[int] = set()
        """addresses of the endpoints besides 0 that answer with a stall"""
        self.in_endpoint = self.out_endpoint = -1
        self.configured = False
        self.opened = False
        self.received = bytearray()
        self.unsent = bytearray()
        """what the device has not taken yet"""
        self.descriptors: dict[str, bytes] = {}
        self._rules = BufferRules(controller, report)
        self._connect_callbacks()

    def _connect_callbacks(self) -> None:
        usb = self._usb
        self._take = usb.dpram_updated
        usb.dpram_updated = self._buffer_control
        usb.on_usb_enabled = None
        usb.on_reset_received = lambda: self._recovery.schedule(RECOVERY_NS)
        usb.on_endpoint_write = self._device_sent
        usb.on_endpoint_read = self._device_ready
        usb.on_reset = None

    # ---- what a program on the host does ----

    def send(self, data: bytes) -> None:
        """Queue bytes for the bulk OUT endpoint."""
        self.unsent += data
        self._pump()

    def control(self, request_type: int, request: int, value: int, index: int, length: int,
                done: Callable[[bytes | None], None], data: bytes = b"") -> None:  # fmt: skip
        setup = struct.pack("<BBHHH", request_type, request, value, index, length)
        self._queue.append(Transfer(setup, data, done))
        if self._current is None:
            self._next()

    def open(self, baud: int = 115200) -> None:
        """Do what opening the serial port does: line coding, then DTR and RTS."""
        self.control(0x21, numbers.SET_LINE_CODING, 0, 0, 7, lambda _: None, struct.pack("<IBBB", baud, 0, 0, 8))
        self._set_lines(numbers.DTR_AND_RTS)

    def close(self) -> None:
        """Do what closing the port does: DTR and RTS fall."""
        self._set_lines(0)

    def _set_lines(self, state: int) -> None:
        self.control(0x21, numbers.SET_CONTROL_LINE_STATE, state, 0, 0, lambda _: self._set_opened(bool(state)))

    def abandon(self) -> None:
        """Cut the control transfer that is under way short; the next one begins at once."""
        self._finish(None)

    def reset_bus(self) -> None:
        """Reset the device, whatever is under way, and enumerate it again."""
        self._queue.clear()
        self._current, self.configured = None, False
        self._usb.reset_device()

    def unplugged(self) -> None:
        """The device has gone from the bus, by a reset of its controller."""
        self.hangs = self.configured = self.opened = False
        self._queue.clear()
        self._current = None
        self._recovery.cancel()
        self.unsent.clear()
        self._read.clear()
        self._usb.reset()

    def _set_opened(self, opened: bool) -> None:
        self.opened = opened
        if opened:
            self.received.clear()

    # ---- enumeration, in the order of Linux ----

    def enumerate(self) -> None:
        """Ask what Linux asks of a device after its reset."""
        if not self._clocked():
            self._report("USB: clk_usb is off, a real controller would not answer")
        self.configured = self.opened = self._settles = False
        self._queue.clear()
        self._current = None
        self._address = 0
        self._toggles = {2: 0}
        self._out_toggle, self._out_room = 0, 0
        self._descriptor("first", numbers.DEVICE, 0, 64)
        self.control(0, numbers.SET_ADDRESS, ADDRESS, 0, 0, lambda _: None)
        self._descriptor("device", numbers.DEVICE, 0, 18)
        self._descriptor("head", numbers.CONFIGURATION, 0, 9)
        self._descriptor("configuration", numbers.CONFIGURATION, 0, 255)

    def _descriptor(self, name: str, kind: int, index: int, length: int) -> None:
        language = 0x409 if kind == numbers.STRING and index else 0

        def keep(data: bytes | None) -> None:
            self.descriptors[name] = data or b""
            if data is not None and not is_descriptor(data, kind):
                self._report(f"USB: {data.hex()} is no {name} descriptor")
            if name == "configuration":
                self._choose()

        self.control(0x80, numbers.GET_DESCRIPTOR, kind << 8 | index, language, length, keep)

    def _choose(self) -> None:
        """Ask for the texts that the device has by the numbers that it gives them, and choose its configuration."""
        numbered = self.descriptors["device"][14:17]
        for index, name in zip((0, *numbered), ("languages", "manufacturer", "product", "serial"), strict=False):
            self._descriptor(name, numbers.STRING, index, 255)
        self.control(0, numbers.SET_CONFIGURATION, 1, 0, 0, self._configured)

    def _configured(self, _: bytes | None) -> None:
        self.configured = True
        if not self._usb.read_uint32(SIE_CTRL) & PULL_UP:
            self._report("USB: the pull-up is off, a real host would not see the device")
        for address, kind in self._kinds.items():
            if kind == numbers.BULK and address & 0x80:
                self.in_endpoint = address & 15
            elif kind == numbers.BULK:
                self.out_endpoint = address

    @property
    def _kinds(self) -> dict[int, int]:
        return endpoint_kinds(self.descriptors.get("configuration", b""))

    # ---- the bus ----

    def _buffer_control(self, offset: int, value: int) -> None:
        """The device hands a buffer over or takes it back."""
        if not 0x80 <= offset < 0x100:
            self._take(offset, value)
            return
        self._rules.note(offset, value)
        if value & AVAILABLE and not self._rules.answers(offset, self._kinds):
            return
        endpoint, device_sends = (offset - 0x80) >> 3, not offset & 4
        if endpoint:
            self._note_stall(endpoint | (0x80 if device_sends else 0), value)
        if value & AVAILABLE and device_sends and endpoint == self.in_endpoint:
            self._check_frame()
        if self.hangs:
            return
        if value & AVAILABLE and device_sends and self.latency_us:
            self._fetches[endpoint].schedule(self.latency_us * 1e3)
        elif value & AVAILABLE and device_sends:
            self._fetch(endpoint)
        else:
            if endpoint == self.out_endpoint and not device_sends:
                self._out_data1 = bool(value & DATA1)
            self._take(offset, value)
        asked = 0x84 if self._current and self._current.stage == "out" else 0x80
        if offset == asked and self._current and self._rules.stalls(offset, value):
            self._finish(None)

    def _note_stall(self, address: int, value: int) -> None:
        if not value & STALL:
            self.stalled.discard(address)
            return
        self.stalled.add(address)
        if address == self.out_endpoint:
            self._out_room = 0

    def _check_frame(self) -> None:
        place_ns = self._usb.rp2040.clock.nanos % FRAME_NS
        if HANGS_NS[0] <= place_ns < HANGS_NS[1]:
            self._report(f"USB: bulk IN armed {place_ns / 1e3:.0f} us after the start of a frame (erratum RP2040-E15)")
            self.hangs = True

    def _fetch(self, endpoint: int) -> None:
        """Take what an IN endpoint has, unless the device has taken it back meanwhile."""
        offset = 0x80 + 8 * endpoint
        value = int.from_bytes(self._usb.rp2040.usb_dpram[offset : offset + 4], "little")
        if self.hangs or not value & AVAILABLE:
            return
        if endpoint in self._toggles:
            if bool(value & DATA1) != bool(self._toggles[endpoint]):
                self._report(f"USB: wrong data toggle on endpoint {endpoint} IN")
            self._toggles[endpoint] ^= 1
        self._take(offset, value)

    def _next(self) -> None:
        self._current = self._queue.popleft() if self._queue and not self._settles else None
        if self._current is None:
            return
        self._toggles[0] = 1
        self._status_armed = False
        self._current.stage = "in" if self._current.reads else ("out" if self._current.data else "status in")
        if self.hangs or not self._rules.listens(self._address):
            return
        self._follow_toggles(self._current.setup)
        self._rules.setup()
        self._usb.send_setup_packet(self._current.setup)

    def _finish(self, result: bytes | None) -> None:
        transfer, self._current = self._current, None
        if transfer:
            self._follow_address(transfer.setup, result)
            transfer.done(result)
        if self._current is None:
            self._next()

    def _follow_address(self, setup: bytes, result: bytes | None) -> None:
        if result is not None and setup[:2] == bytes((0, numbers.SET_ADDRESS)):
            self._address, self._settles = setup[2], True
            self._settling.schedule(SETTLING_NS)

    def _settled(self) -> None:
        self._settles = False
        if self._current is None:
            self._next()

    def _follow_toggles(self, setup: bytes) -> None:
        """CLEAR_FEATURE(ENDPOINT_HALT), SET_CONFIGURATION and SET_INTERFACE begin anew with DATA0."""
        index = int.from_bytes(setup[4:6], "little")
        chosen = setup[:4] == bytes((1, SET_INTERFACE, 0, 0)) and index == 1
        chosen = chosen or setup[:2] == bytes((0, numbers.SET_CONFIGURATION))
        halt = setup[:2] == bytes((2, numbers.CLEAR_FEATURE))
        if chosen or (halt and index == 0x80 | self.in_endpoint):
            self._toggles[self.in_endpoint] = 0
        if chosen or (halt and index == self.out_endpoint):
            self._out_toggle = 0

    def _device_sent(self, endpoint: int, buffer: bytes) -> None:
        if endpoint == self.in_endpoint:
            self._read += bytes(buffer)
            if len(buffer) < BULK_BYTES or len(self._read) >= READ_BYTES:
                self.received += self._read
                self._read.clear()
            return
        transfer = self._current
        if endpoint or not transfer:
            return
        if transfer.stage == "in":
            transfer.received += bytes(buffer)
            if len(buffer) < ENDPOINT0_BYTES or len(transfer.received) >= transfer.length:
                transfer.stage = "status out"
                self._status_out()
        elif transfer.stage == "status in":
            if len(buffer):
                self._report(f"USB: a status stage of {len(buffer)} bytes, none may come")
            self._finish(b"")

    def _status_out(self) -> None:
        transfer = self._current
        if self._status_armed and transfer and transfer.stage == "status out":
            self._status_armed = False
            self._usb.endpoint_read_done(0, b"")
            self._finish(bytes(transfer.received))

    def _device_ready(self, endpoint: int, room: int) -> None:
        if endpoint:
            self._out_room = room
            self._pump()
        elif self._current and self._current.stage == "out":
            self._usb.endpoint_read_done(0, self._current.data)
            self._current.stage = "status in"
        else:
            self._status_armed = True
            self._status_out()

    def _pump(self) -> None:
        if self.configured and self._out_room and self.unsent and not self.hangs:
            count = min(self._out_room, len(self.unsent))
            packet = bytes(self.unsent[:count])
            del self.unsent[:count]
            self._out_room = 0
            if bool(self._out_toggle) != self._out_data1:
                self._report(f"USB: wrong data toggle on endpoint {self.out_endpoint} OUT")
            self._out_toggle ^= 1
            self._usb.endpoint_read_done(self.out_endpoint, packet)
