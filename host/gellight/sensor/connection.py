"""A sensor as long as it is plugged in: its camera set and its ring lit as asked.

`sensor_camera.py` opens one, and another one when the sensor is back after it was unplugged. Only frames are delivered
that were exposed after camera and ring were set, and while the ring was lit: `LightRing` knows since when it is.
"""

import logging
import re
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError, GellightError
from gellight.frames.frames import CameraFrame
from gellight.ring.light_ring import LightRing, connect
from gellight.sensor.discovery import DEV, SYSFS, Discovery, Sensor, discover
from gellight.sensor.v4l2.errors import Kernel, StalledError, UnpluggedError
from gellight.sensor.v4l2.options import CaptureOptions
from gellight.sensor.v4l2.video_camera import V4l2Camera

logger = logging.getLogger(__name__)

WATCH_S = 2.0
"""how often controls are looked at while frames come"""
OLD_S = 5.0
"""frames from before the light are waited out for this long"""


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """Where devices are and how they are opened; tests give others."""

    kernel: Kernel
    sysfs: Path = SYSFS
    dev: Path = DEV
    open_ring: Callable[[str], LightRing] = connect
    wait: Callable[[threading.Event, float], object] = threading.Event.wait

    def look(self) -> Discovery:
        """Look at what is plugged in now."""
        return discover(sysfs=self.sysfs, dev=self.dev)


@dataclass(frozen=True, eq=False)
class ConnectOptions:
    """How a sensor is to be set and lit."""

    options: CaptureOptions
    """of the URL and, where it does not say, of the calibration"""
    colours: NDArray[np.uint8] | None
    """(12, 3) RGB of the LEDs; None: dark"""
    shape: tuple[int, int] | None = None
    """(H, W) that the frames should have, where the URL does not say"""


class Connection:
    """The open camera and ring of one sensor; `close` makes the LEDs dark."""

    ring: LightRing | None

    def __init__(
        self, sensor: Sensor, options_for: Callable[[LightRing | None], ConnectOptions], *,
        named_ring: str | None, url: str, around: Surroundings,
    ) -> None:  # fmt: skip
        """Open, set and light `sensor`; raises CameraError, BoardError or InputError, and then the LEDs are dark.

        options_for: says, of the open ring, how camera and ring are to be set. named_ring: URL of the ring to open;
        None: the one beside the camera.
        """
        self.sensor = sensor
        self._named_ring = named_ring
        self._clock = around.kernel.clock
        self.ring = self._open_ring(around)
        try:
            self.wanted = wanted = options_for(self.ring)
            self.camera = V4l2Camera(
                sensor.camera.path, wanted.options, shape=wanted.shape, url=url, kernel=around.kernel,
                sysfs=around.sysfs,
            )  # fmt: skip
        except BaseException:
            _darken(self.ring)
            raise
        try:
            self._light(wanted.colours)
        except BaseException:
            self.close()
            raise
        self._set_s = self._watched_s = self._clock()

    def _open_ring(self, around: Surroundings) -> LightRing | None:
        """Open the ring that the URL names, or else the one beside the camera, which has to be the board it was."""
        if self._named_ring is not None:
            return around.open_ring(self._named_ring)
        node = self.sensor.ring
        if node is None:
            return None
        ring = around.open_ring(node.path)
        found, expected = ring.hello.unique_id.hex().upper(), node.usb.serial if node.usb else ""
        if re.fullmatch(r"[0-9a-fA-F]{16}", expected) and expected.upper() != found:
            ring.close()
            raise BoardError(
                f"the ring at {ring.transport.url} is {found}, the one beside the camera is {expected}: ring and "
                "camera are of different sensors; unplug both and plug them in again"
            )
        return ring

    def _light(self, colours: NDArray[np.uint8] | None) -> None:
        if self.ring is not None:
            self.ring.light(colours)

    def apply(self, wanted: ConnectOptions, controls: Mapping[str, float]) -> None:
        """Set these controls, and light the ring, in the same mode; frames are of the new light after that."""
        self.camera.controls.lock(controls, power_line_hz=int(wanted.options.power_line_hz))
        self._light(wanted.colours)
        self._set_s = self._clock()

    def newest(self) -> CameraFrame:
        """Wait for the newest frame that was exposed after camera and ring were set, while the ring was lit.

        Raises UnpluggedError, StalledError or BoardError where the sensor cannot go on as it is.
        """
        begun_s = self._clock()
        while self._clock() < max(begun_s, self._set_s) + OLD_S:
            frame = self.camera.read()
            self._watch()
            # How late a camera stamps its frames is often not known: a frame counts once it was lit in any case.
            if self.camera.timing.span_s(frame.time_s)[0] > self._lit_since_s():
                return frame
        if self.ring is not None and self._lit_since_s() == inf:
            raise BoardError(self.ring.heat.why_dark(f"sensor {self.sensor.name}"))
        raise StalledError(f"{self.sensor.camera.stable}: its time stamps stand still; it is started anew")

    def _lit_since_s(self) -> float:
        """From when on frames show what was set; BoardError where the board does not answer."""
        if self.ring is None:
            return self._set_s
        return max(self._set_s, self.ring.lit_since_s() + self.camera.timing.pulse_period_s)

    def _watch(self) -> None:
        """Look whether the board is there, and now and then whether the controls are as they have to be.

        A board that loses its power has dark LEDs at once, and no port until it has started again.
        """
        node = self.sensor.ring
        if node is not None and self._named_ring is None and not Path(node.path).exists():
            raise UnpluggedError(f"the light ring at {node.path} was unplugged: plug it in again")
        now_s = self._clock()
        if now_s - self._watched_s < WATCH_S:
            return
        self._watched_s = now_s
        if wrong := self.camera.controls.deviations():
            raise StalledError(
                f"somebody changed the camera: {', '.join(map(str, wrong))}; it is set anew, end other programmes"
            )

    def close(self) -> None:
        """Make the LEDs dark and close the camera; what is gone cannot object."""
        _darken(self.ring)
        try:
            self.camera.close()
        except CameraError as error:
            logger.warning("%s", error)


def _darken(ring: LightRing | None) -> None:
    """Close a ring, whatever state it is in: its board darkens the LEDs by itself when the host is silent."""
    if ring is not None:
        try:
            ring.close()
        except GellightError as error:
            logger.warning("%s", error)
