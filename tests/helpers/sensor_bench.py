"""A computer with a kernel and a bus made of nothing, into which sensors are plugged and from which they are pulled."""

import time
from math import inf
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from gellight.base.errors import BoardError
from gellight.bundle.bundle import Bundle, LedSetting, write_bundle
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.ring.light_ring import LATCH_TIMEOUT_S
from gellight.sensor.connection import Surroundings
from gellight.sensor.sensor_camera import SensorCamera, open_sensor
from tests.helpers.fake_kernel import FakeCamera, FakeKernel
from tests.helpers.linear_sensor import linear_network
from tests.helpers.scripted_ring import BOARD, ScriptedRing
from tests.helpers.usb_tree import UsbTree


class BenchRing(ScriptedRing):
    """A ring on the kernel's time: its LEDs shine 20 ms after they are set."""

    def __init__(self, kernel: FakeKernel, url: str, unique_id: str = BOARD) -> None:
        super().__init__(unique_id=unique_id)
        self.kernel, self.lit_s = kernel, 0.0
        self.transport: Any = SimpleNamespace(url=url)
        self.refusal: BoardError | None = None
        self.mute = self.untold = False

    def clock(self, host_us: int = 0) -> Any:
        if self.mute:
            raise BoardError("the board did not answer CLOCK")

    def lit_since_s(self) -> float:
        """As a ring whose board spoke last more than half a second ago; what became dark is lit again soon after."""
        self.clock()
        if self.untold:
            self.untold = False
            self.kernel.at(self.kernel.now_s + 0.25, lambda: self.light(self.still))
            self.lit_s = inf
        return self.lit_s

    def go_dark(self) -> None:
        """What a board does that does not hear from its host for a second; it tells it when it is asked."""
        self.lit, self.untold = np.zeros((12, 3), np.uint8), True

    def set_leds(self, colours: np.ndarray) -> Any:
        if self.refusal and colours.any():
            raise self.refusal
        return super().set_leds(colours)

    def light(self, colours: np.ndarray | None, timeout_s: float = LATCH_TIMEOUT_S) -> int:
        light_id = super().light(colours, timeout_s)
        self.kernel.sleep(0.02)
        self.lit_s = self.kernel.now_s
        return light_id


class Paced(CameraWrapper):
    """A camera of the bench in real time: its virtual time would race ahead."""

    def read(self) -> CameraFrame:
        time.sleep(0.002)
        return self._camera.read()


class Bench:
    """A computer with a bus; sensors are plugged in and pulled out."""

    def __init__(self, root: Path) -> None:
        self.kernel, self.usb, self.rings = FakeKernel(), UsbTree(root), []  # type: ignore[var-annotated]
        self.board = BOARD
        self.cameras: dict[str, FakeCamera] = {}

    def plug(self, port: str, serial: str, **changes: Any) -> FakeCamera:
        camera = FakeCamera(payload=lambda number: bytes([128, number % 256] * 32 * 24), **changes)
        node, _ = self.usb.plug(port, serial=serial, cameras=1, rings=1)
        self.kernel.cameras[node] = self.cameras[port] = camera
        camera.next_s = self.kernel.now_s
        return camera

    def unplug(self, port: str) -> None:
        self.cameras[port].plugged = False
        self.usb.unplug(port)

    def open_ring(self, url: str) -> Any:
        if not Path(url).exists() and "://" not in url:
            raise BoardError(f"cannot open {url}")
        self.rings.append(BenchRing(self.kernel, url, self.board))
        return self.rings[-1]

    @property
    def surroundings(self) -> Surroundings:
        return Surroundings(kernel=self.kernel, sysfs=self.usb.sysfs, dev=self.usb.dev, open_ring=self.open_ring,
                            wait=lambda event, seconds: self.kernel.sleep(seconds))  # fmt: skip

    def open(self, url: str, bundle: Bundle | None = None) -> SensorCamera:
        return open_sensor(url, bundle=bundle, surroundings=self.surroundings)

    def all_dark(self) -> bool:
        return not any(ring.lit.any() or not ring.closed for ring in self.rings)


def lit_bundle(folder: Path) -> Bundle:
    """A bundle of the sensor GL0001 with a light and settings of its own."""
    colours = [((255, 0, 0), "R"), ((0, 200, 0), "G"), ((0, 0, 90), "B")]
    return write_bundle(
        folder, sensor="GL0001", reference=np.full((24, 32, 3), 100.0), reference_frames=1,
        noise_grey=1.0, pixel_size_mm=(0.1, 0.1), network=linear_network(), metrics={},
        led=tuple(LedSetting(colour=name, rgb=rgb) for rgb, name in colours for _ in range(4)),  # type: ignore[arg-type]
        camera={"exposure_us": 8000, "white_balance_k": 5000, "format": "YUYV"},
    )  # fmt: skip
