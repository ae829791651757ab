"""The camera function of the device (UVC): negotiates, takes pictures while the host streams, and sends them."""

import random
import struct
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from gellight.base.errors import CameraError
from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame
from tests.virtual_usb import controls, descriptors
from tests.virtual_usb.cable import UsbCable
from tests.virtual_usb.controls import ControlState, set_up
from tests.virtual_usb.descriptors import VideoModes
from tests.virtual_usb.encoding import Mark, binned, to_jpeg, to_yuyv
from tests.virtual_usb.faults import Faults

PROBE, COMMIT = 1, 2
"""selectors of the negotiation (UVC 1.1, 4.3.1.1)"""
HEADER_BYTES = 2
_BLOCK = struct.Struct("<HBBIHHHHHIIIBBBB")
END_OF_HEADER, ERROR, END_OF_FRAME = 0x80, 0x40, 0x02
LATENCY_FRAMES = 2
"""a new value of a control acts on the second picture after it was set, as on sensors that take over registers once a
frame"""
IDLE_S = 0.02


def modes_of(camera: Camera, frame_rate: float) -> VideoModes:
    """Return what a camera offers over USB: its size and, binned, half of it; its rate, half and a quarter of it."""
    height, width = camera.image_shape
    sizes = [(width, height), (width // 2, height // 2)] if width % 4 == 0 == height % 2 else [(width, height)]
    return VideoModes(tuple(sizes), tuple(round(1e7 * divider / frame_rate) for divider in (1, 2, 4)))


@dataclass(frozen=True)
class StreamMode:
    format: int
    size_index: int
    """from 1"""
    interval: int
    """100 ns"""


class Negotiation:
    """The camera's side; `committed` is the mode in which it streams, None while it does not."""

    def __init__(self, modes: VideoModes) -> None:
        self._modes = modes
        self._probed = StreamMode(descriptors.MJPG, 1, modes.intervals[0])
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
            min(max(wanted, descriptors.MJPG), descriptors.YUYV),
            min(max(size, 1), len(self._modes.sizes)),
            min(offered, key=lambda known: abs(known - interval)) if interval else offered[0],
        )

    def _pack(self) -> bytes:
        mode = self._probed
        size = self._modes.picture_bytes(mode.size_index)
        return _BLOCK.pack(1, mode.format, mode.size_index, mode.interval, 0, 0, 0, 0, 0, size, size + HEADER_BYTES,
                           descriptors.CLOCK_HZ, 3, 1, 1, 1)  # fmt: skip


class VideoFunction:
    """Interfaces 2 and 3. One thread runs it; requests of the host come from another."""

    def __init__(self, camera: Camera, modes: VideoModes, *, faults: Faults) -> None:
        self.controls = ControlState()
        self.negotiation = Negotiation(modes)
        self.streams = 0
        """how often the host began to stream"""
        self._camera, self._modes = camera, modes
        self._faults = faults
        self._random = random.Random(0)
        self._toggle = self._taken = 0
        self._values: deque[dict[str, int]] = deque(maxlen=LATENCY_FRAMES)
        self._last: bytes | None = None

    def inject(self, faults: Faults) -> None:
        """Behave like this from the next picture on."""
        self._faults = faults

    def request(self, interface: int, unit: int, selector: int, code: int, data: bytes) -> bytes | None:
        """Answer a class request; None: refused."""
        if interface == descriptors.STREAMING_INTERFACE:
            return self.negotiation.request(selector, code, data)
        return self.controls.request(unit, selector, code, data) if interface == descriptors.CONTROL_INTERFACE else None

    def run(self, cable: UsbCable) -> None:
        """Stream whenever the host has committed a mode, until the cable is pulled (CablePulledError)."""
        while True:
            mode = self.negotiation.committed
            if mode is None:
                cable.sleep_until(time.monotonic() + IDLE_S, lambda: True)
            else:
                self.streams += 1
                self._stream(cable, mode, lambda mode=mode: self.negotiation.committed is mode)  # type: ignore[misc]

    def _stream(self, cable: UsbCable, mode: StreamMode, wanted: Callable[[], bool]) -> None:
        count, due_s = 0, time.monotonic()
        self._last = None
        self._values.clear()
        while wanted():
            count += 1
            faults = self._faults
            cable.sleep_until(due_s, wanted)
            values, frame = self._expose(mode)
            due_s += max(time.monotonic() - due_s, values["exposure_us"] * 1e-4)  # long exposures slow the camera down
            if not (faults.stall_after and count > faults.stall_after):
                self._send(cable, self._encode(frame, mode, values), faults, wanted)

    def _expose(self, mode: StreamMode) -> tuple[dict[str, int], CameraFrame]:
        """Take the next picture at the negotiated rate."""
        self._values.append(self.controls.snapshot())
        values = self._values[0]
        if self._camera.controls is None:
            raise CameraError(f"{self._camera.url} has no controls: give the virtual sensor a camera that has them")
        set_up(self._camera.controls, values)
        for _ in range(round(mode.interval / self._modes.intervals[0])):
            frame = self._camera.read()
            self._taken += 1
        return values, frame

    def _encode(self, frame: CameraFrame, mode: StreamMode, values: dict[str, int]) -> bytes:
        image = binned(frame.image, self._modes.sizes[mode.size_index - 1])
        if mode.format == descriptors.MJPG:
            return to_jpeg(image, Mark(self._taken, frame.time_s, values["exposure_us"] * 100))
        return to_yuyv(image)

    def _send(self, cable: UsbCable, picture: bytes, faults: Faults, wanted: Callable[[], bool]) -> None:
        """Send a picture as one payload, after doing to it what the faults say."""
        chance = self._random.random
        if chance() < faults.drop:
            return
        if self._last is not None and chance() < faults.duplicate:
            picture = self._last
        self._last = picture
        if chance() < faults.torn:
            picture = picture[: len(picture) // 2]
        damaged = ERROR if chance() < faults.error else 0
        if faults.late_ms:
            cable.sleep_until(time.monotonic() + chance() * faults.late_ms * 1e-3, wanted)
        header = bytes((HEADER_BYTES, END_OF_HEADER | END_OF_FRAME | self._toggle | damaged))
        self._toggle ^= 1
        cable.send(descriptors.VIDEO_ENDPOINT, header + picture, wanted=wanted)
