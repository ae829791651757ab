"""A kernel with V4L2 cameras made of nothing, on virtual time: what a driver does with buffers, controls and cables.

A frame is complete `latency_s` after its stamp. A complete frame goes into the queued buffer that has waited longest;
if none is queued it is lost, and its sequence number with it. That is what uvcvideo does.
"""

import errno
import select
from collections import deque
from collections.abc import Callable
from ctypes import Structure
from dataclasses import dataclass, field

import pytest

from gellight.sensor.v4l2 import controls as c
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.kernel import Kernel


@dataclass
class FakeControl:
    minimum: int
    maximum: int
    step: int = 1
    value: int = 0
    automatic: tuple[int, int] | None = None
    """(number, value) of the control that has to be so before this one can be set"""
    keeps: Callable[[int], int] = lambda value: value
    """what the camera makes of a value that is set"""


def usual_controls() -> dict[int, FakeControl]:
    return {
        c.EXPOSURE_AUTO: FakeControl(0, 3, 1, 3),
        c.EXPOSURE: FakeControl(1, 5000, 1, 157, (c.EXPOSURE_AUTO, 1)),
        c.DYNAMIC_RATE: FakeControl(0, 1, 1, 1),
        c.GAIN: FakeControl(0, 100, 1, 0),
        c.WHITE_BALANCE_AUTO: FakeControl(0, 1, 1, 1),
        c.WHITE_BALANCE: FakeControl(2800, 6500, 10, 4600, (c.WHITE_BALANCE_AUTO, 0)),
        c.POWER_LINE: FakeControl(0, 2, 1, 1),
    }


def usual_formats() -> dict[str, dict[tuple[int, int], list[int]]]:
    return {"MJPG": {(640, 480): [60, 30, 15], (1280, 720): [30]}, "YUYV": {(640, 480): [30], (32, 24): [30]},
            "RGB3": {(32, 24): [30]}, "GREY": {(32, 24): [30]}, "H264": {(640, 480): [30]}}  # fmt: skip


@dataclass
class FakeCamera:
    payload: Callable[[int], bytes] = lambda number: b"\xff\xd8" + number.to_bytes(4) + b"\xff\xd9"
    formats: dict[str, dict[tuple[int, int], list[int]]] = field(default_factory=usual_formats)
    controls: dict[int, FakeControl] = field(default_factory=usual_controls)
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
        self.number, self.next_s = 0, 0.0
        self.streams = 0

    @property
    def period_s(self) -> float:
        return 1 / self.mode[3]

    def advance(self, now_s: float) -> None:
        while self.streaming and self.plugged and not self.stalled and self.next_s + self.latency_s <= now_s:
            number, time_s = self.number, self.next_s
            self.number, self.next_s = number + 1, time_s + self.period_s
            if self.queued and not self.missing(number):
                self._fill(self.queued.popleft(), number, time_s)

    def _fill(self, index: int, number: int, time_s: float) -> None:
        data, stamp = self.payload(number), self.stamp(number, time_s)
        self.contents[index][: len(data)] = data
        buffer = v.Buffer(index=index, bytesused=len(data), sequence=self.sequence(number))
        buffer.flags = self.flags | self.bad(number)
        buffer.timestamp.seconds, buffer.timestamp.microseconds = int(stamp), round(stamp % 1 * 1e6)
        self.filled.append(buffer)

    def stop(self) -> None:
        self.streaming = False
        self.queued.clear()
        self.filled.clear()


class FakeMemory:
    def __init__(self, content: bytearray) -> None:
        self.content, self.closed = content, False

    def __getitem__(self, part: slice) -> bytes:
        assert not self.closed
        return bytes(self.content[part])

    def close(self) -> None:
        self.closed = True


def refuse(number: int) -> OSError:
    return OSError(number, errno.errorcode[number])


class FakeKernel(Kernel):
    """Cameras by path; `now_s` moves when somebody waits."""

    def __init__(self, cameras: dict[str, FakeCamera] | None = None) -> None:
        self.cameras = cameras or {}
        self.now_s = 100.0
        self.opened: dict[int, FakeCamera] = {}
        self.mapped: list[FakeMemory] = []
        self.events: list[tuple[float, Callable[[], None]]] = []

    def take_over(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Take the place of Linux for everything that names no kernel of its own."""
        for name in ("open", "ioctl", "mmap", "poll", "close", "clock"):
            monkeypatch.setattr(Kernel, name, getattr(self, name))

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        """Let something happen at a time, while somebody waits."""
        self.events = sorted([*self.events, (time_s, action)], key=lambda event: event[0])

    def sleep(self, seconds: float) -> None:
        self._until(self.now_s + seconds)

    def _until(self, time_s: float) -> None:
        while self.events and self.events[0][0] <= time_s:
            moment, action = self.events.pop(0)
            self._move(max(moment, self.now_s))
            action()
        self._move(time_s)

    def _move(self, time_s: float) -> None:
        self.now_s = time_s
        for camera in self.cameras.values():
            camera.advance(time_s)

    def clock(self) -> float:
        return self.now_s

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

    def mmap(self, descriptor: int, length: int, offset: int) -> FakeMemory:
        camera = self.opened[descriptor]
        self.mapped.append(FakeMemory(camera.contents.setdefault(offset, bytearray(length))))
        return self.mapped[-1]

    def poll(self, descriptor: int, timeout_s: float) -> int:
        camera, deadline_s = self.opened[descriptor], self.now_s + timeout_s
        while True:
            if not camera.plugged or not camera.streaming:
                return select.POLLERR | select.POLLHUP
            if camera.filled:
                return select.POLLIN
            if self.now_s >= deadline_s:
                return 0
            soonest = [camera.next_s + camera.latency_s] if not camera.stalled else []
            soonest += [self.events[0][0]] if self.events else []
            self._until(min([deadline_s, *(moment for moment in soonest if moment > self.now_s)]))

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        camera = self.opened[descriptor]
        if not camera.plugged:
            raise refuse(errno.ENODEV)
        if request in camera.errors:
            raise refuse(camera.errors[request])
        getattr(self, HANDLERS[request])(camera, argument)

    def querycap(self, camera: FakeCamera, answer: v.Capability) -> None:
        answer.driver, answer.card, answer.bus_info = camera.driver.encode(), camera.card.encode(), b"usb-fake-1"
        answer.capabilities, answer.device_caps = v.CAP_DEVICE_CAPS | camera.capabilities, camera.capabilities

    def enum_fmt(self, camera: FakeCamera, entry: v.FormatDescription) -> None:
        entry.pixelformat = v.code_of(list(camera.formats)[self._index(entry, len(camera.formats))])

    def enum_framesizes(self, camera: FakeCamera, entry: v.FrameSize) -> None:
        sizes = list(camera.formats.get(v.fourcc(entry.pixel_format), {}))
        entry.type = v.FRAME_DISCRETE
        entry.size.values[:2] = sizes[self._index(entry, len(sizes))]

    def enum_frameintervals(self, camera: FakeCamera, entry: v.FrameInterval) -> None:
        rates = camera.formats[v.fourcc(entry.pixel_format)][(entry.width, entry.height)]
        entry.type = v.FRAME_DISCRETE
        entry.values[:2] = [10_000_000 // rates[self._index(entry, len(rates))], 10_000_000]

    @staticmethod
    def _index(entry: Structure, count: int) -> int:
        index: int = entry.index  # type: ignore[attr-defined]
        if index >= count:
            raise refuse(errno.EINVAL)
        return index

    def s_fmt(self, camera: FakeCamera, argument: v.Format) -> None:
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

    def s_parm(self, camera: FakeCamera, argument: v.StreamParameters) -> None:
        rates = camera.formats[camera.mode[0]][camera.mode[1:3]]
        asked = argument.denominator / argument.numerator
        camera.mode = (*camera.mode[:3], min(rates, key=lambda offered: abs(offered - asked)))
        self.g_parm(camera, argument)

    def g_parm(self, camera: FakeCamera, argument: v.StreamParameters) -> None:
        argument.numerator, argument.denominator = 10_000_000 // camera.mode[3], 10_000_000

    def reqbufs(self, camera: FakeCamera, argument: v.RequestBuffers) -> None:
        camera.stop()

    def querybuf(self, camera: FakeCamera, buffer: v.Buffer) -> None:
        buffer.length, buffer.m.offset = camera.size_bytes, buffer.index

    def qbuf(self, camera: FakeCamera, buffer: v.Buffer) -> None:
        camera.queued.append(buffer.index)

    def dqbuf(self, camera: FakeCamera, buffer: v.Buffer) -> None:
        if not camera.filled:
            raise refuse(errno.EAGAIN)
        found = camera.filled.popleft()
        for name, *_ in v.Buffer._fields_:
            setattr(buffer, name, getattr(found, name))

    def streamon(self, camera: FakeCamera, argument: v.Int) -> None:
        camera.streaming, camera.next_s, camera.number = True, self.now_s, 0
        camera.streams += 1

    def streamoff(self, camera: FakeCamera, argument: v.Int) -> None:
        camera.stop()

    def queryctrl(self, camera: FakeCamera, answer: v.ControlDescription) -> None:
        control = self._control(camera, answer.id)
        answer.minimum, answer.maximum, answer.step = control.minimum, control.maximum, control.step

    def g_ctrl(self, camera: FakeCamera, argument: v.Control) -> None:
        argument.value = self._control(camera, argument.id).value

    def s_ctrl(self, camera: FakeCamera, argument: v.Control) -> None:
        control = self._control(camera, argument.id)
        if control.automatic and camera.controls[control.automatic[0]].value != control.automatic[1]:
            return  # a driver takes the value and forgets it
        if not control.minimum <= argument.value <= control.maximum:
            raise refuse(errno.ERANGE)
        control.value = control.keeps(argument.value)

    @staticmethod
    def _control(camera: FakeCamera, number: int) -> FakeControl:
        if number not in camera.controls:
            raise refuse(errno.EINVAL)
        return camera.controls[number]


HANDLERS = {
    getattr(v, name): name.lower()
    for name in (
        *("QUERYCAP", "ENUM_FMT", "ENUM_FRAMESIZES", "ENUM_FRAMEINTERVALS", "S_FMT", "REQBUFS", "QUERYBUF", "QBUF"),
        *("DQBUF", "STREAMON", "STREAMOFF", "QUERYCTRL", "G_CTRL", "S_CTRL", "G_PARM", "S_PARM"),
    )
}
