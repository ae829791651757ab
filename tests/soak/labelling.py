"""Labels of light under faults, on virtual time: on the firmware's image, whatever this computer is busy with.

Sensor, connection, ring and sequence are the product's; kernel, board and clock are one thread that nothing else of the
computer can hold up. So every label can be judged, and a run is the same each time.
"""

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.base.errors import BoardError, GellightError
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import ReconnectingError
from gellight.ring import board_link, light_ring
from gellight.ring.firmware.targets import committed_image
from gellight.ring.light_groups import colour_triples
from gellight.ring.light_ring import LightRing
from gellight.sensor.connection import Surroundings
from gellight.sensor.lighting import light_watch
from gellight.sensor.lighting.sequenced import SequencedCamera
from gellight.sensor.sensor_camera import open_sensor
from tests.helpers.bench_board import BenchBoard, VirtualTransport
from tests.helpers.simulated_kernel import SLICE_S, SimulatedKernel
from tests.helpers.virtual_sensor import HostClock
from tests.soak.faults import OF_SENSOR, PlannedFault, maltreat
from tests.soak.hardware import SERIAL, SHUTTER, FragileSensor, WiredTransport
from tests.soak.judging import RECOVERY_S, Invariant, Judge

logger = logging.getLogger(__name__)
KEEP_ALIVE_S = 0.25
LEAST_S = 1e-6
"""of waiting: time that stands still would never end it"""
QUIET_S = 1.0


class VirtualKernel(SimulatedKernel):
    """Cameras on the clock of `host`; `look` is called now and then while a program waits, as a thread of it would."""

    def __init__(self, host: HostClock, look: Callable[[], object]) -> None:
        super().__init__()
        self._host, self._look = host, look

    def clock(self) -> float:
        return self._host.monotonic()

    def wait_until(self, time_s: float) -> None:
        """Let time pass, up to `time_s` or less, and the cameras take what is due."""
        self._host.sleep(min(max(time_s - self.clock(), LEAST_S), SLICE_S))
        self.advance()
        self._look()


class Cable(VirtualTransport):
    """Ends for good where the board loses its power."""

    def __init__(self, sensor: "VirtualSensor") -> None:
        self._sensor, self._start = sensor, sensor.starts
        self._connected()
        super().__init__(sensor.board)

    def _connected(self) -> None:
        if not self.board_is_on:
            raise BoardError("the board is gone: plug it in again")

    @property
    def board_is_on(self) -> bool:
        return self._sensor.board.powered and self._start == self._sensor.starts

    def write(self, data: bytes) -> None:
        self._connected()
        super().write(data)

    def read(self, timeout_s: float) -> bytes:
        self._connected()
        return super().read(timeout_s)

    def close(self) -> None:
        if self.board_is_on:
            super().close()


class VirtualSensor(FragileSensor):
    """A sensor whose board and host go by virtual time, all in one thread."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.board = BenchBoard(committed_image())
        self.clock = HostClock(self.board)
        super().__init__(folder, seed, VirtualKernel(self.clock, self._keep_alive))
        self.starts = 0
        """how often the board was given power"""
        self._ring: LightRing | None = None
        self._asked_s = 0.0

    @property
    def surroundings(self) -> Surroundings:
        return replace(super().surroundings, wait=lambda _event, seconds: self.clock.sleep(seconds))

    def _open_ring(self, url: str) -> LightRing:
        self._ring = LightRing(WiredTransport(Cable(self), self.wires), keep_alive_s=None)
        return self._ring

    def _keep_alive(self) -> None:
        """Ask for the time, as the ring's own thread would, which nobody waits for where no answer can come."""
        if self._ring is None or self.wires.silent or self.clock.monotonic() < self._asked_s + KEEP_ALIVE_S:
            return
        with suppress(BoardError):
            self._ring.clock()
        self._asked_s = self.clock.monotonic()

    def _power_on(self, serial: Path) -> None:
        self.starts += 1
        self.board.power_on()
        serial.touch()

    def _cut_power(self) -> None:
        self.board.power_off()

    def _lights(self, start_s: float) -> NDArray[np.uint8]:
        start_us = self.clock.board_us(start_s)
        seen = self.board.timeline.interval(start_us - SHUTTER.pulse_period_us, start_us + SHUTTER.duration_us)
        return np.stack([light.colours for light in seen])


@contextmanager
def clock_in_force(clock: HostClock) -> Iterator[None]:
    """Let what follows light go by this clock; nothing else may use a ring in this process meanwhile."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (board_link, light_ring, light_watch):
            patch.setattr(module, "time", clock)
        yield


class Labelling:
    """A camera under a sequence of lights, through faults of its sensor, with its labels judged."""

    def __init__(self, seed: int, folder: Path, bundle: Bundle) -> None:
        """Make the sensor in `folder`; its lights are the bundle's, a colour at a time."""
        assert bundle.colours is not None
        self.sensor = VirtualSensor(folder, seed)
        self.judge = Judge(self.sensor)
        self.faults = 0
        """that were made"""
        self.slowest_s = 0.0
        """from the end of a fault until a frame was called clean again, of the host's time"""
        self._bundle, self._groups = bundle, colour_triples(bundle.colours)

    def run(self, faults: Iterable[PlannedFault], note: Callable[[str], object] = logger.info) -> None:
        """Make those of the faults that are of the sensor; `note` is told of each. An error ends it, as a daemon."""
        with clock_in_force(self.sensor.clock):
            self.sensor.plug()
            try:
                around = self.sensor.surroundings
                camera = open_sensor(f"sensor://{SERIAL}", bundle=self._bundle, surroundings=around)
                with SequencedCamera(camera, self._groups) as self._camera:
                    self._follow(QUIET_S)
                    for fault in faults:
                        if fault.kind in OF_SENSOR:
                            self._suffer(fault, note)
            except GellightError as error:
                self.judge.broken(Invariant.RUNNING, f"labels: {error}")
        if self.sensor.board.faults:
            self.judge.broken(Invariant.FIRMWARE, "; ".join(self.sensor.board.faults[:3]))

    def _suffer(self, fault: PlannedFault, note: Callable[[str], object]) -> None:
        """Make a fault, and go on until a frame is called clean again."""
        maltreat(self.sensor, fault, self._follow)
        clock, labels = self.sensor.clock, self.judge.labels
        begun_s = clock.monotonic()
        while self.judge.labels == labels and clock.monotonic() < begun_s + RECOVERY_S:
            self._read()
        taken_s, self.faults = clock.monotonic() - begun_s, self.faults + 1
        self.slowest_s = max(self.slowest_s, taken_s)
        if self.judge.labels == labels:
            self.judge.broken(Invariant.RECOVERY, f"no frame was called clean for {taken_s:.1f} s after {fault.kind}")
        note(f"{fault.at_s / 3600:6.2f} h  {fault.kind:18} {fault.seconds:4.1f} s  labels    {taken_s:5.2f} s")
        self._follow(QUIET_S)

    def _follow(self, seconds: float) -> None:
        end_s = self.sensor.clock.monotonic() + seconds
        while self.sensor.clock.monotonic() < end_s:
            self._read()

    def _read(self) -> None:
        with suppress(ReconnectingError):
            self.judge.frame(self._camera.read(), light=None, groups=self._groups)
