"""Probe and commit: how host and camera agree on format, size and rate (UVC 1.1, 4.3.1.1)."""

import struct
from dataclasses import dataclass

from gellight.simulator.usb import controls
from gellight.simulator.usb.descriptors import CLOCK_HZ, MJPG, YUYV, VideoModes

PROBE, COMMIT = 1, 2
HEADER_BYTES = 2
_BLOCK = struct.Struct("<HBBIHHHHHIIIBBBB")


@dataclass(frozen=True)
class StreamMode:
    """What is streamed."""

    format: int
    size_index: int
    """from 1"""
    interval: int
    """100 ns"""


class Negotiation:
    """The camera's side; `committed` is the mode in which it streams, None while it does not."""

    def __init__(self, modes: VideoModes) -> None:
        """Offer `modes`."""
        self._modes = modes
        self._probed = StreamMode(MJPG, 1, modes.intervals[0])
        self.committed: StreamMode | None = None

    def request(self, selector: int, code: int, data: bytes) -> bytes | None:
        """Answer a request to the streaming interface; None: refused."""
        if selector not in (PROBE, COMMIT):
            return None
        if code == controls.SET_CURRENT:
            if len(data) < 8:
                return None
            self._probed = self._nearest(data)
            if selector == COMMIT:
                self.committed = self._probed
            return b""
        if code == controls.GET_INFO:
            return b"\x03"
        if code == controls.GET_LENGTH:
            return struct.pack("<H", _BLOCK.size)
        if code in (controls.GET_CURRENT, controls.GET_MINIMUM, controls.GET_MAXIMUM, controls.GET_DEFAULT):
            return self._pack()
        return None

    def _nearest(self, data: bytes) -> StreamMode:
        """Return the offered mode that is nearest to what the host asks for."""
        _hint, wanted, size, interval = struct.unpack_from("<HBBI", data)
        offered = self._modes.intervals
        return StreamMode(
            min(max(wanted, MJPG), YUYV),
            min(max(size, 1), len(self._modes.sizes)),
            min(offered, key=lambda known: abs(known - interval)) if interval else offered[0],
        )

    def _pack(self) -> bytes:
        mode = self._probed
        size = self._modes.picture_bytes(mode.size_index)
        return _BLOCK.pack(1, mode.format, mode.size_index, mode.interval, 0, 0, 0, 0, 0, size, size + HEADER_BYTES,
                           CLOCK_HZ, 3, 1, 1, 1)  # fmt: skip
