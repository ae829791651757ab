"""How the firmware may hand the buffers of the USB controller over, and which endpoints answer (data sheet 4.1.2)."""

from collections.abc import Callable
from typing import Any

from tests.helpers import usb_numbers as numbers

AVAILABLE, STALL, DATA1 = 1 << 10, 1 << 11, 1 << 13
CYCLE_NS = 1e9 / 48e6
"""of clk_usb"""
ENABLED, TYPE_AT = 1 << 31, 26
"""of the control word of an endpoint"""
BUFFERS, DPRAM_BYTES, PACKET = 0x180, 4096, 64
CONFIGURATION_BYTES = 9


def endpoint_kinds(configuration: bytes) -> dict[int, int]:
    """Return the kind of each endpoint by its address, as the descriptors tell it."""
    kinds, rest = {}, configuration
    while rest and rest[0]:
        if rest[1] == numbers.ENDPOINT:
            kinds[rest[2]] = rest[3] & 3
        rest = rest[rest[0] :]
    return kinds


def is_descriptor(data: bytes, kind: int) -> bool:
    """Say whether an answer tells its own kind, and its length (USB 2.0, 9.5); a configuration has others behind it."""
    whole = len(data) >= 2 and (
        data[0] == len(data) or (kind == numbers.CONFIGURATION and data[0] == CONFIGURATION_BYTES)
    )
    return whole and data[1] == kind


class BufferRules:
    """Watches the words by which buffers are handed over."""

    def __init__(self, controller: Any, report: Callable[[str], None]) -> None:
        """Report what real silicon would not forgive."""
        self._usb, self._report = controller, report
        self._words: dict[int, tuple[int, float]] = {}

    def note(self, offset: int, value: int) -> None:
        """Note a word. AVAILABLE goes last, later than the same word without it by a cycle of clk_usb (4.1.2.5.1)."""
        now_ns = self._usb.rp2040.clock.nanos
        before, at_ns = self._words.get(offset, (-1, 0.0))
        self._words[offset] = value, now_ns
        if value & AVAILABLE and (before != value & ~AVAILABLE or now_ns - at_ns < CYCLE_NS):
            self._report(f"USB: AVAILABLE of buffer 0x{offset:x} comes with the rest of its word, or too soon after it")

    def answers(self, offset: int, kinds: dict[int, int]) -> bool:
        """Whether the endpoint of a buffer is on; it has to be of the kind that its descriptor tells."""
        endpoint, device_sends = (offset - 0x80) >> 3, not offset & 4
        if not endpoint:
            return True
        at = 8 * endpoint + (0 if device_sends else 4)
        control = int.from_bytes(self._usb.rp2040.usb_dpram[at : at + 4], "little")
        address, buffer = endpoint | device_sends << 7, control & 0xFFC0
        if not control & ENABLED or control >> TYPE_AT & 3 != kinds.get(address):
            self._report(f"USB: endpoint 0x{address:02x} is off, or not of the kind in its descriptor")
        elif not BUFFERS <= buffer <= DPRAM_BYTES - PACKET:
            self._report(f"USB: the buffer of endpoint 0x{address:02x} is at 0x{buffer:x}")
        return bool(control & ENABLED)

    def stalls(self, offset: int, value: int) -> bool:
        """Whether a buffer of endpoint 0 answers with a stall, which EP_STALL_ARM has to allow (4.1.2.5.3)."""
        if not value & STALL:
            return False
        armed = bool(self._usb._ep_stall_arm >> (offset >> 2 & 1) & 1)
        if not armed:
            self._report("USB: endpoint 0 is to stall, but EP_STALL_ARM does not say so")
        return armed

    def listens(self, address: int) -> bool:
        """Whether the controller answers at an address: ADDR_ENDP says it, also after a reset of the bus (4.1)."""
        own = self._usb._addr_endp & 0x7F
        if own != address:
            self._report(f"USB: the host speaks to address {address}, the device listens at {own}")
        return bool(own == address)

    def setup(self) -> None:
        """A SETUP packet ends what EP_STALL_ARM allows."""
        self._usb._ep_stall_arm = 0
