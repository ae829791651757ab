"""What the tests of heat share: a light, what is left of it when it is dimmed, and time that passes."""

from gellight.ring import protocol as p
from tests.firmware.helpers.virtual_board import VirtualBoard

SETTLED_US = 15_000_000
"""the smoothed temperature is within a hundredth of a degree, and the next dimming has come"""
PATTERN = bytes([200, 0, 1] + [0] * 33)
HALVED = {
    0: PATTERN,
    1: bytes([100, 0, 1] + [0] * 33),
    2: bytes([50, 0, 1] + [0] * 33),
    3: bytes([25, 0, 1] + [0] * 33),
}


def wait(core: VirtualBoard, duration_us: int) -> list[p.DimmedEvent]:
    """Let time pass, keep the light on, and return what the board said of its dimming."""
    found = []
    while duration_us > 0:
        core.ok("CLOCK", p.ClockRequest(0))
        core.advance(min(duration_us, 500_000))
        duration_us -= 500_000
        packets = [*core.packets, *core.collect()]
        core.packets.clear()
        found += [p.DimmedEvent.unpack(packet.payload) for packet in packets if packet.type == p.EVENTS["DIMMED"][0]]
    return found
