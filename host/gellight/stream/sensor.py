"""`gellight.connect`: a sensor in this process, lit and calibrated, that gives tactile frames."""

from __future__ import annotations

import atexit
import time
import weakref
from contextlib import ExitStack, suppress

from gellight.base.settings import load_settings
from gellight.bundle.bundle import Bundle
from gellight.daemon.assembly import open_session
from gellight.daemon.calls import Call, Commands
from gellight.daemon.session import SensorSession
from gellight.frames.frames import TactileFrame
from gellight.frames.status import SensorStatus
from gellight.stream.source import BACKLOG, PATIENCE_S, FrameSource


def connect(
    url: str = "auto",
    *,
    calibration: str | None = None,
    mode: str | None = None,
    every: bool = False,
    patience_s: float = PATIENCE_S,
) -> Sensor:
    """Open a sensor, light its LEDs as its calibration says, and start to reconstruct; closing it makes them dark.

    `url` is `auto` (the one sensor that is plugged in), `sensor://NAME`, `v4l2:///dev/...`, `sim://`, a recording
    (`replay://FILE`) or a folder of images. `calibration` is a bundle, `synthetic`, or `auto`: the one that the board
    of the sensor names; what is not given is as in the settings (docs/configuration.md). every: give every frame and
    not only the newest. Raises CameraError, BoardError, BundleError, InputError or ConfigError with the remedy.
    """
    settings = load_settings({"sensor.url": url, "sensor.calibration": calibration, "reconstruction.mode": mode})
    return Sensor(open_session(settings, every=every), every=every, patience_s=patience_s)


_OPEN: weakref.WeakSet[Sensor] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """Close what a program left open: threads that wait for Python when it has ended would abort the process."""
    for sensor in list(_OPEN):
        with suppress(Exception):  # a callback of `listen` that failed was told
            sensor.close()


class Sensor(FrameSource):
    """A daemon in this process."""

    def __init__(self, daemon: SensorSession, *, every: bool = False, patience_s: float = PATIENCE_S) -> None:
        """Start `daemon`, and stop it at the end."""
        super().__init__(patience_s=patience_s, every=every)
        self.daemon, self._calls = daemon, Commands(daemon)
        self._until = ExitStack()
        self._frames = self._until.enter_context(daemon.delivered.subscribe(BACKLOG)) if every else daemon.delivered
        self._number = 0
        self._given = -1
        """with `every`: the sequence number of the frame that was given last"""
        self._until.enter_context(daemon)
        _OPEN.add(self)
        daemon.go_on_after(-1)

    def _take(self, timeout_s: float) -> TactileFrame:
        until_s = time.monotonic() + timeout_s
        while True:
            self._number, frame = self._frames.take(self._number, max(until_s - time.monotonic(), 0.0))
            sequence = frame.camera_frame.sequence
            self.daemon.go_on_after(sequence)
            if not self._every or sequence > self._given:  # a picture is reconstructed anew where the mode has changed
                self._given = sequence
                return frame

    def _why_none(self) -> str:
        return str(self.daemon.status()["error"] or "the camera delivers none; see `gellight doctor`")

    def _release_all(self) -> None:
        self._until.close()

    def status(self) -> SensorStatus:
        """Return `SensorSession.status`."""
        return self.daemon.status()

    @property
    def bundle(self) -> Bundle:
        """The calibration bundle in use, with the zero in use."""
        return self.daemon.zeroed_bundle

    def _ask(self, call: Call) -> bytes:
        return self._calls.take(call)()
