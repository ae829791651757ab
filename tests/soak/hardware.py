"""A sensor to be maltreated: a camera in a simulated kernel, and a ring whose board runs the core of the firmware.

Its plug, power, serial line and pictures can be disturbed at any moment. What it really showed is remembered: every
picture carries its number in its pixels, and by that number it is known when it was exposed and under which light.
"""

import logging
import random
import threading
import time
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, GellightError
from gellight.lab.simulator.shutter import Shutter
from gellight.ring.light_ring import LightRing
from gellight.ring.transport import Transport, open_transport
from gellight.ring.wire import LED_COUNT
from gellight.sensor.connection import Surroundings
from gellight.sensor.v4l2 import structures as v
from tests.helpers.simulated_kernel import CameraDevice, SimulatedKernel
from tests.helpers.terminal_board import TerminalBoard, cut_power
from tests.helpers.usb_tree import UsbTree
from tests.soak.pressed_gel import SHAPE, PressedGel, marked
from tests.virtual_usb.encoding import Mark, to_jpeg, to_yuyv
from tests.virtual_usb.faults import NO_FAULTS, Faults

logger = logging.getLogger(__name__)
SERIAL = "SOAK0001"
SHUTTER = Shutter(transfer_us=5000.0)
KEPT_EXPOSURES = 4000


@dataclass(frozen=True, eq=False)
class Exposure:
    """What a picture really is."""

    number: int
    start_s: float
    """start of the exposure, `time.monotonic`"""
    lights: NDArray[np.uint8]
    """(n, 12, 3) every light that some row saw, in order"""


class SoakCamera(CameraDevice):
    """The camera of a sensor; its pictures show the gel under the light that was on."""

    def __init__(self, sensor: "FragileSensor") -> None:
        self._sensor, self._last, self._goes_on_s = sensor, b"", 0.0
        height, width = SHAPE
        super().__init__(
            formats={letters: {(width, height): [30]} for letters in ("YUYV", "MJPG")},
            driver="soak",  # its stamps are taken at their word: the start of the exposure
            latency_s=(SHUTTER.duration_us + SHUTTER.transfer_us) * 1e-6,
            stamp=lambda number, time_s: time_s + sensor.clock_error_s,
            missing=lambda number: sensor.chance(sensor.faults.drop),
            bad=lambda number: v.FLAG_ERROR if sensor.chance(sensor.faults.error) else 0,
        )

    def content(self, number: int, time_s: float) -> bytes:
        """Return the picture as the camera sends it, after doing to it what the faults say."""
        faults, chance = self._sensor.faults, self._sensor.chance
        picture = self._last
        if not picture or not chance(faults.duplicate):
            image, exposure = self._sensor.expose(time_s)
            mark = Mark(exposure.number, time_s, int(SHUTTER.exposure_us))
            picture = to_jpeg(image, mark) if self.mode[0] == "MJPG" else to_yuyv(image)
        self._last = picture
        return picture[: len(picture) // 2] if chance(faults.torn) else picture

    def stall(self, seconds: float) -> None:
        """Send nothing for so long; the next picture is exposed then."""
        self._goes_on_s = self._sensor.kernel.clock() + seconds
        self.stalled = True

    def advance(self, now_s: float) -> None:
        if self.stalled and now_s >= self._goes_on_s:
            self.stalled, self.next_s = False, self._goes_on_s
        super().advance(now_s)


class FragileSensor(ABC):
    """One sensor on a bus and in a kernel of its own, whatever its board is."""

    def __init__(self, folder: Path, seed: int, kernel: SimulatedKernel) -> None:
        """Make a bus in `folder`; `kernel` is given its camera."""
        self.gel = PressedGel()
        self.kernel, self.usb = kernel, UsbTree(folder)
        self.wires = Wires(draw=random.Random(seed))
        self.faults: Faults = NO_FAULTS
        self.clock_error_s = 0.0
        """by which the camera's time stamps are off"""
        self._random = random.Random(seed + 1)
        self._exposures: OrderedDict[int, Exposure] = OrderedDict()
        self._count = self._sockets = 0
        self.port = ""
        self.camera: SoakCamera | None = None

    @property
    def surroundings(self) -> Surroundings:
        return Surroundings(kernel=self.kernel, sysfs=self.usb.sysfs, dev=self.usb.dev, open_ring=self._open_ring)

    @abstractmethod
    def _open_ring(self, url: str) -> LightRing:
        """Connect to the board at `url` through `wires`."""

    @abstractmethod
    def _power_on(self, serial: Path) -> None:
        """Give the board power, at this node from now on."""

    @abstractmethod
    def _cut_power(self) -> None:
        """Take the power of the board."""

    @abstractmethod
    def _lights(self, start_s: float) -> NDArray[np.uint8]:
        """(n, 12, 3) every light that some row of an exposure from `start_s` on saw, in order."""

    def chance(self, share: float) -> bool:
        """Return whether something happens that happens in this share of the cases."""
        return share > 0 and self._random.random() < share

    # ---- plug and power ----

    def plug(self) -> None:
        """Plug the sensor in, at another port than before; its board has power and runs when this returns."""
        self._sockets += 1
        self.port = f"1-{self._sockets % 4 + 1}"
        self.camera = SoakCamera(self)
        video, serial = self.usb.plug(self.port, serial=SERIAL, cameras=1, rings=1)
        Path(serial).unlink()
        self._power_on(Path(serial))
        self.kernel.cameras = {video: self.camera}

    def unplug(self) -> None:
        if self.camera is not None:
            self.camera.plugged = False
        self.usb.unplug(self.port)
        self._cut_power()
        self.kernel.cameras, self.camera = {}, None

    def brown_out(self, wait: Callable[[], object]) -> None:
        """Let the supply of the board dip while `wait` lasts, then it is at its node again; the camera goes on."""
        nodes = (path for path in self.usb.plugged[self.port] if path.parent == self.usb.dev)
        serial = next(path for path in nodes if "tty" in path.name)
        serial.unlink()
        self._cut_power()
        wait()
        self._power_on(serial)

    # ---- light and pictures ----

    def expose(self, start_s: float) -> tuple[NDArray[np.uint8], Exposure]:
        """Return the picture that was exposed from `start_s` on, and remember what it shows."""
        lights = self._lights(start_s)
        self._count += 1
        exposure = Exposure(self._count, start_s, lights)
        self._exposures[self._count] = exposure
        if len(self._exposures) > KEPT_EXPOSURES:
            self._exposures.popitem(last=False)
        image = digitised(self.gel.picture(lights.mean(axis=0)), np.random.default_rng(self._count))
        return marked(image, self._count), exposure

    def exposure(self, number: int) -> Exposure | None:
        """Return what the picture of this number really is; None where there was none, or it is long ago."""
        return self._exposures.get(number)


class SoakSensor(FragileSensor):
    """A sensor on the wall clock, and its board; close it at the end."""

    def __init__(self, folder: Path, seed: int) -> None:
        super().__init__(folder, seed, SimulatedKernel())
        self.board: TerminalBoard | None = None
        self._boards = threading.Lock()
        """held while the board is changed"""

    def _open_ring(self, url: str) -> LightRing:
        try:
            return LightRing(WiredTransport(open_transport(url), self.wires), timeout_s=0.25)
        except GellightError as error:
            raise BoardError(f"{url}: {error}") from error

    def _power_on(self, serial: Path) -> None:
        with self._boards:
            self.board = TerminalBoard()
        serial.symlink_to(self.board.path)

    def _cut_power(self) -> None:
        with self._boards:
            board, self.board = self.board, None
        if board is not None:
            cut_power(board)
            board.close()

    def close(self) -> None:
        if self.camera is not None:
            self.unplug()

    def lit(self) -> bool:
        with self._boards:
            board = self.board
        return board is not None and board.running and bool(board.timeline.at(np.inf).any())

    def _lights(self, start_s: float) -> NDArray[np.uint8]:
        with self._boards:
            board = self.board
        dark = np.zeros((1, LED_COUNT, 3), np.uint8)
        try:
            if board is None or not board.running:
                return dark
            start_us = board.virtual_us(start_s)
            lights = board.light_during(start_us - SHUTTER.pulse_period_us, start_us + SHUTTER.duration_us)
            return np.stack([light.colours for light in lights])
        except GellightError as error:
            logger.info("the light of a picture is not known: %s", error)
            return dark


def digitised(picture: NDArray[np.float32], draw: np.random.Generator) -> NDArray[np.uint8]:
    """Return (H, W, 3) grey levels as a camera with some noise has them."""
    noisy = picture + draw.integers(0, 3, picture.shape, np.uint8)
    return np.asarray(np.clip(noisy, 0, 255), np.uint8)


@dataclass
class Wires:
    flipped: float = 0.0
    """share of the bytes that arrive with a wrong bit, in either direction"""
    silent: bool = False
    """nothing gets through"""
    draw: random.Random = field(default_factory=lambda: random.Random(0))

    def pass_on(self, data: bytes) -> bytes:
        if self.silent or not self.flipped:
            return b"" if self.silent else data
        flip = self.draw
        return bytes(byte ^ (1 << flip.randrange(8)) if flip.random() < self.flipped else byte for byte in data)


class WiredTransport:
    def __init__(self, transport: Transport, wires: Wires) -> None:
        self.url, self._transport, self._wires = transport.url, transport, wires
        self.monotonic: Callable[[], float] = getattr(transport, "monotonic", time.monotonic)

    def write(self, data: bytes) -> None:
        if arriving := self._wires.pass_on(data):
            self._transport.write(arriving)

    def read(self, timeout_s: float) -> bytes:
        """Return what got through; bytes that are lost end no waiting."""
        end_s = self.monotonic() + timeout_s
        while True:
            left_s = end_s - self.monotonic()
            data = self._wires.pass_on(self._transport.read(max(left_s, 0.0)))
            if data or left_s <= 0:
                return data

    def close(self) -> None:
        self._transport.close()
