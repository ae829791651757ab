"""A kernel with V4L2 cameras made of nothing: what a driver does with buffers, controls and cables, on the wall clock.

A frame is complete `latency_s` after its stamp. A complete frame goes into the queued buffer that has waited longest;
if none is queued it is lost, and its sequence number with it. That is what uvcvideo does.
"""

import errno
import select
import time
from collections import deque
from collections.abc import Callable
from ctypes import Structure
from dataclasses import dataclass, field
from typing import Any

from gellight.sensor.v4l2 import controls as c
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.errors import Kernel

SLICE_S = 0.01
"""who waits for a picture looks so often whether the plug was pulled"""


@dataclass
class DeviceControl:
    minimum: int
    maximum: int
    step: int = 1
    value: int = 0
    automatic: tuple[int, int] | None = None
    """(number, value) of the control that has to be so before this one can be set"""
    keeps: Callable[[int], int] = lambda value: value
    """what the camera makes of a value that is set"""


def usual_controls() -> dict[int, DeviceControl]:
    """Return the controls of a usual webcam, all automatics on."""
    return {
        c.EXPOSURE_AUTO: DeviceControl(0, 3, 1, 3),
        c.EXPOSURE: DeviceControl(1, 5000, 1, 157, (c.EXPOSURE_AUTO, 1)),
        c.DYNAMIC_RATE: DeviceControl(0, 1, 1, 1),
        c.GAIN: DeviceControl(0, 100, 1, 0),
        c.WHITE_BALANCE_AUTO: DeviceControl(0, 1, 1, 1),
        c.WHITE_BALANCE: DeviceControl(2800, 6500, 10, 4600, (c.WHITE_BALANCE_AUTO, 0)),
        c.POWER_LINE: DeviceControl(0, 2, 1, 1),
    }


def usual_formats() -> dict[str, dict[tuple[int, int], list[int]]]:
    """Return what a usual webcam offers: frame rates by format and (width, height)."""
    return {"MJPG": {(640, 480): [60, 30, 15], (1280, 720): [30]}, "YUYV": {(640, 480): [30], (32, 24): [30]},
            "RGB3": {(32, 24): [30]}, "GREY": {(32, 24): [30]}, "H264": {(640, 480): [30]}}  # fmt: skip


@dataclass
class CameraDevice:
    """A camera; functions of the number of a frame say what is wrong with it."""

    payload: Callable[[int], bytes] = lambda number: b"\xff\xd8" + number.to_bytes(4) + b"\xff\xd9"
    formats: dict[str, dict[tuple[int, int], list[int]]] = field(default_factory=usual_formats)
    controls: dict[int, DeviceControl] = field(default_factory=usual_controls)
    card: str = "Fake camera"
    driver: str = "uvcvideo"
    capabilities: int = v.CAP_VIDEO_CAPTURE | v.CAP_STREAMING
    latency_s: float = 0.010
    flags: int = v.TIMESTAMP_MONOTONIC | v.SOURCE_SOE
    stamp: Callable[[int, float], float] = lambda number, time_s: time_s
    sequence: Callable[[int], int] = lambda number: number
    bad: Callable[[int], int] = lambda number: 0
    """flags of a frame besides the usual"""
    missing: Callable[[int], bool] = lambda number: False
    """frames that never arrive"""
    plugged: bool = True
    stalled: bool = False
    busy: bool = False
    denied: bool = False
    mode: tuple[str, int, int, int] = ("YUYV", 640, 480, 30)
    streaming: bool = False
    errors: dict[int, int] = field(default_factory=dict)
    """errno by request"""

    def __post_init__(self) -> None:
        self.queued: deque[int] = deque()
        self.filled: deque[v.Buffer] = deque()
        self.contents: dict[int, bytearray] = {}
        self.mapped: list[DeviceMemory] = []
        self.number, self.next_s = 0, 0.0
        self.streams = self.size_bytes = 0

    @property
    def period_s(self) -> float:
        return 1 / self.mode[3]

    def advance(self, now_s: float) -> None:
        while self.streaming and self.plugged and not self.stalled and self.next_s + self.latency_s <= now_s:
            number, time_s = self.number, self.next_s
            self.number, self.next_s = number + 1, time_s + self.period_s
            if self.queued and not self.missing(number):
                self._fill(self.queued.popleft(), number, time_s)

    def content(self, number: int, time_s: float) -> bytes:
        """Return the picture whose exposure began at `time_s`."""
        return self.payload(number)

    def _fill(self, index: int, number: int, time_s: float) -> None:
        data, stamp = self.content(number, time_s), self.stamp(number, time_s)
        self.contents[index][: len(data)] = data
        buffer = v.Buffer(index=index, bytesused=len(data), sequence=self.sequence(number))
        buffer.flags = self.flags | self.bad(number)
        buffer.timestamp.seconds, buffer.timestamp.microseconds = int(stamp), round(stamp % 1 * 1e6)
        self.filled.append(buffer)

    def stop(self) -> None:
        self.streaming = False
        self.queued.clear()
        self.filled.clear()


class DeviceMemory:
    def __init__(self, content: bytearray) -> None:
        self.content, self.closed = content, False

    def __getitem__(self, part: slice) -> bytes:
        assert not self.closed
        return bytes(self.content[part])

    def close(self) -> None:
        self.closed = True


def refuse(number: int) -> OSError:
    return OSError(number, errno.errorcode[number])


class SimulatedKernel(Kernel):
    """Cameras by path. One thread reads a camera; any thread may pull its plug, stall it or set its controls."""

    def __init__(self, cameras: dict[str, CameraDevice] | None = None) -> None:
        """Begin with these cameras; others may be added at any time."""
        self.cameras = cameras or {}
        self.opened: dict[int, CameraDevice] = {}

    def clock(self) -> float:
        return time.monotonic()

    def wait_until(self, time_s: float) -> None:
        """Let time pass, up to `time_s` or less, and the cameras take what is due."""
        time.sleep(min(max(time_s - self.clock(), 0.0), SLICE_S))
        self.advance()

    def advance(self) -> None:
        """Let every camera take the pictures that are due."""
        for camera in list(self.cameras.values()):
            camera.advance(self.clock())

    def open(self, path: str) -> int:
        camera = self.cameras.get(path)
        if camera is None or not camera.plugged:
            raise refuse(errno.ENOENT)
        if camera.denied:
            raise refuse(errno.EACCES)
        descriptor = max(self.opened, default=2) + 1
        self.opened[descriptor] = camera
        return descriptor

    def close(self, descriptor: int) -> None:
        self.opened.pop(descriptor).stop()

    def mmap(self, descriptor: int, length: int, offset: int) -> Any:
        camera = self.opened[descriptor]
        camera.mapped.append(DeviceMemory(camera.contents.setdefault(offset, bytearray(length))))
        return camera.mapped[-1]

    def poll(self, descriptor: int, timeout_s: float) -> int:
        """Wait for a picture or a fault; see `Kernel.poll`."""
        camera, deadline_s = self.opened[descriptor], self.clock() + timeout_s
        while True:
            if not camera.plugged or not camera.streaming:
                return select.POLLERR | select.POLLHUP
            if camera.filled:
                return select.POLLIN
            now_s = self.clock()
            if now_s >= deadline_s:
                return 0
            due_s = camera.next_s + camera.latency_s
            self.wait_until(due_s if now_s < due_s < deadline_s and not camera.stalled else deadline_s)

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        """Do what the driver does; see `Kernel.ioctl`."""
        camera = self.opened[descriptor]
        if not camera.plugged:
            raise refuse(errno.ENODEV)
        if request in camera.errors:
            raise refuse(camera.errors[request])
        getattr(self, HANDLERS[request])(camera, argument)

    def _querycap(self, camera: CameraDevice, answer: v.Capability) -> None:
        answer.driver, answer.card, answer.bus_info = camera.driver.encode(), camera.card.encode(), b"usb-fake-1"
        answer.capabilities, answer.device_caps = v.CAP_DEVICE_CAPS | camera.capabilities, camera.capabilities

    def _enum_fmt(self, camera: CameraDevice, entry: v.FormatDescription) -> None:
        entry.pixelformat = v.code_of(list(camera.formats)[self._index(entry, len(camera.formats))])

    def _enum_framesizes(self, camera: CameraDevice, entry: v.FrameSize) -> None:
        sizes = list(camera.formats.get(v.fourcc(entry.pixel_format), {}))
        entry.type = v.FRAME_DISCRETE
        entry.size.values[:2] = sizes[self._index(entry, len(sizes))]

    def _enum_frameintervals(self, camera: CameraDevice, entry: v.FrameInterval) -> None:
        rates = camera.formats[v.fourcc(entry.pixel_format)][(entry.width, entry.height)]
        entry.type = v.FRAME_DISCRETE
        entry.values[:2] = [10_000_000 // rates[self._index(entry, len(rates))], 10_000_000]

    @staticmethod
    def _index(entry: Structure, count: int) -> int:
        index: int = entry.index
        if index >= count:
            raise refuse(errno.EINVAL)
        return index

    def _s_fmt(self, camera: CameraDevice, argument: v.Format) -> None:
        if camera.busy:
            raise refuse(errno.EBUSY)
        pix = argument.fmt.pix
        letters = v.fourcc(pix.pixelformat)
        sizes = camera.formats.get(letters) or next(iter(camera.formats.values()))
        pix.width, pix.height = min(sizes, key=lambda size: abs(size[0] - pix.width) + abs(size[1] - pix.height))
        pix.bytesperline = pix.width * {"YUYV": 2, "RGB3": 3, "GREY": 1}.get(letters, 0)
        pix.sizeimage = pix.bytesperline * pix.height or 600_000
        camera.mode = (letters, pix.width, pix.height, camera.mode[3])
        camera.contents = {}
        camera.size_bytes = pix.sizeimage

    def _s_parm(self, camera: CameraDevice, argument: v.StreamParameters) -> None:
        rates = camera.formats[camera.mode[0]][camera.mode[1:3]]
        asked = argument.denominator / argument.numerator
        camera.mode = (*camera.mode[:3], min(rates, key=lambda offered: abs(offered - asked)))
        self._g_parm(camera, argument)

    def _g_parm(self, camera: CameraDevice, argument: v.StreamParameters) -> None:
        argument.numerator, argument.denominator = 10_000_000 // camera.mode[3], 10_000_000

    def _reqbufs(self, camera: CameraDevice, argument: v.RequestBuffers) -> None:
        camera.mapped = [memory for memory in camera.mapped if not memory.closed]
        if camera.mapped:  # a driver cannot free what is still mapped
            raise refuse(errno.EBUSY)
        camera.stop()

    def _querybuf(self, camera: CameraDevice, buffer: v.Buffer) -> None:
        buffer.length, buffer.m.offset = camera.size_bytes, buffer.index

    def _qbuf(self, camera: CameraDevice, buffer: v.Buffer) -> None:
        camera.queued.append(buffer.index)

    def _dqbuf(self, camera: CameraDevice, buffer: v.Buffer) -> None:
        if not camera.filled:
            raise refuse(errno.EAGAIN)
        found = camera.filled.popleft()
        for name, *_ in v.Buffer._fields_:
            setattr(buffer, name, getattr(found, name))

    def _streamon(self, camera: CameraDevice, argument: v.Int) -> None:
        camera.streaming, camera.next_s, camera.number = True, self.clock(), 0
        camera.streams += 1

    def _streamoff(self, camera: CameraDevice, argument: v.Int) -> None:
        camera.stop()

    def _queryctrl(self, camera: CameraDevice, answer: v.ControlDescription) -> None:
        control = self._control(camera, answer.id)
        answer.minimum, answer.maximum, answer.step = control.minimum, control.maximum, control.step

    def _g_ctrl(self, camera: CameraDevice, argument: v.Control) -> None:
        argument.value = self._control(camera, argument.id).value

    def _s_ctrl(self, camera: CameraDevice, argument: v.Control) -> None:
        control = self._control(camera, argument.id)
        if control.automatic and camera.controls[control.automatic[0]].value != control.automatic[1]:
            return  # a driver takes the value and forgets it
        if not control.minimum <= argument.value <= control.maximum:
            raise refuse(errno.ERANGE)
        control.value = control.keeps(argument.value)

    @staticmethod
    def _control(camera: CameraDevice, number: int) -> DeviceControl:
        if number not in camera.controls:
            raise refuse(errno.EINVAL)
        return camera.controls[number]


HANDLERS = {
    getattr(v, name): f"_{name.lower()}"
    for name in (
        *("QUERYCAP", "ENUM_FMT", "ENUM_FRAMESIZES", "ENUM_FRAMEINTERVALS", "S_FMT", "REQBUFS", "QUERYBUF", "QBUF"),
        *("DQBUF", "STREAMON", "STREAMOFF", "QUERYCTRL", "G_CTRL", "S_CTRL", "G_PARM", "S_PARM"),
    )
}
