"""A sensor on virtual time: the firmware image in the emulator, a rolling shutter, and a host with a clock of its own.

Nothing waits for the wall clock, so that it is the same on every machine. The host's clock has an offset and a drift.
"""

from typing import Any

import numpy as np
import pytest

from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.lab.core_board.light_timeline import Light
from gellight.lab.simulator.shutter import Shutter, row_weights
from gellight.ring import board_link, light_ring
from gellight.ring.firmware.targets import committed_image
from gellight.ring.light_ring import LightRing
from gellight.sensor import set_and_light
from gellight.sensor.lighting import light_watch
from tests.helpers.bench_board import BenchBoard, VirtualTransport

SHAPE = (64, 128)
RING = np.zeros((12, 3), np.uint8)
for third in range(3):
    RING[4 * third : 4 * third + 4, third] = 255


class HostClock:
    """Takes the place of the module `time` in what is tested."""

    def __init__(self, board: BenchBoard, *, offset_s: float = 5000.0, drift: float = 60e-6) -> None:
        self.board, self.offset_s, self.drift = board, offset_s, drift

    def monotonic(self) -> float:
        return self.offset_s + self.board.now_us * 1e-6 / (1 + self.drift)

    def sleep(self, seconds: float) -> None:
        self.board.run(seconds * 1e6)

    def board_us(self, host_s: float) -> float:
        return (host_s - self.offset_s) * 1e6 * (1 + self.drift)


def irradiances() -> np.ndarray:
    """(12, H, W) of a flat gel under LEDs around it, each falling off with the square of its distance."""
    y, x = np.indices(SHAPE) / np.array(SHAPE).reshape(2, 1, 1) - 0.5
    angles = np.arange(12) * np.pi / 6
    squared = (x - np.cos(angles)[:, None, None]) ** 2 + (y - np.sin(angles)[:, None, None]) ** 2 + 0.2
    return np.asarray(40 / squared)


class VirtualCamera(Camera):
    """Free-running, rolling shutter; with `strobe` its frames drive the board's trigger pin."""

    url, image_shape, stage = "virtual://", SHAPE, None

    def __init__(self, board: BenchBoard, clock: HostClock, *, fps: float = 30.0, seed: int = 0,
                 strobe: bool = False, jitter_s: float = 5e-4, late_s: float = 0.0) -> None:  # fmt: skip
        self.board, self.clock, self.strobe, self.jitter_s, self.late_s = board, clock, strobe, jitter_s, late_s
        self.ring = LightRing(VirtualTransport(board), keep_alive_s=None)
        self.shutter = Shutter(exposure_us=8000.0, readout_us=12000.0, transfer_us=5000.0, pulse_period_us=500.0)
        self.rng = np.random.default_rng(seed)
        self.phases_us = 500.0 * self.rng.random(12)
        self.period_s = 1 / fps
        self.begin_s = clock.monotonic() + self.period_s * self.rng.random()
        self.count = 0
        self.lit = irradiances()

    def _wait(self, host_s: float) -> None:
        left_us = self.clock.board_us(host_s) - self.board.now_us
        if left_us > 0:
            self.board.run(left_us)

    def read(self) -> CameraFrame:
        taken_s = 0.0 if self.strobe else (self.shutter.duration_us + self.shutter.transfer_us) * 1e-6
        while self.begin_s + self.count * self.period_s + taken_s < self.clock.monotonic():
            self.count += 1
        start_s = self.begin_s + self.count * self.period_s
        if self.strobe:
            self._wait(start_s)
            self.board.set_trigger(True)
            self._wait(start_s + 0.001)
            self.board.set_trigger(False)
        self._wait(start_s + (self.shutter.duration_us + self.shutter.transfer_us) * 1e-6)
        start_us = self.clock.board_us(start_s)
        lights = self.board.timeline.interval(start_us - 500.0, start_us + self.shutter.duration_us)
        weights = row_weights(lights, start_us, self.image_shape[0], self.phases_us, self.shutter)
        self.last = start_us, weights
        self.count += 1
        stamp_s = start_s + self.late_s + self.rng.uniform(-1, 1) * self.jitter_s
        return CameraFrame(image=self.picture(weights), time_s=stamp_s, sequence=self.count)

    def picture(self, weights: np.ndarray) -> np.ndarray:
        """(H, W, 3) uint8 under (H, 12, 3) or (12, 3)."""
        weights = np.broadcast_to(weights, (SHAPE[0], 12, 3))
        grey = np.einsum("nhw,hnc->hwc", self.lit, weights) + self.rng.normal(0, 1, (*SHAPE, 3))
        return np.asarray(np.clip(np.round(grey), 0, 255), np.uint8)

    def truth(self, groups: np.ndarray) -> LightLabel | None:
        """What the last frame truly was; None for dark."""
        start_us, seen = self.last
        if not seen.any():
            return None
        for number, group in enumerate(groups):
            pure = row_weights([Light(0.0, group)], start_us, self.image_shape[0], self.phases_us, self.shutter)
            if np.abs(seen - pure).max() < 1e-9:
                return LightLabel(state=LightState.CLEAN, group=number)
        return LightLabel(state=LightState.MIXED)

    def close(self) -> None:
        assert self.ring is not None
        self.ring.close()


def virtual_sensor(monkeypatch: pytest.MonkeyPatch, **options: Any) -> VirtualCamera:
    """A new sensor; the modules that are tested get its clock instead of the wall clock."""
    board = BenchBoard(committed_image())
    clock = HostClock(board)
    for module in (board_link, light_ring, light_watch, set_and_light):
        monkeypatch.setattr(module, "time", clock)
    return VirtualCamera(board, clock, **options)
