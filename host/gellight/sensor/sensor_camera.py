"""A real sensor: its camera set and its ring lit as the calibration bundle says, found again after it was unplugged.

What is read is always from the sensor that was opened first, known by its serial number or else its USB port, and was
exposed after its ring was lit. While the sensor is away, `read` raises ReconnectingError and looks for it; frames go on
with rising sequence numbers, so nothing that was taken before is ever taken for new.
"""

import logging
import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError, GellightError, InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera, CameraControls, CameraTiming, ChooseBundle, ReconnectingError
from gellight.frames.frames import CameraFrame
from gellight.frames.status import CameraStatus
from gellight.ring.light_ring import LightRing
from gellight.sensor.connection import Connection, ConnectOptions, Surroundings
from gellight.sensor.discovery import Discovery, Node, Sensor
from gellight.sensor.v4l2.controls import KNOBS
from gellight.sensor.v4l2.errors import LINUX, StalledError, UnpluggedError
from gellight.sensor.v4l2.options import CaptureOptions, parse_url
from gellight.sensor.v4l2.stream import Counts

logger = logging.getLogger(__name__)

LOOK_S = 0.5
"""for which one `read` looks for a sensor that is away"""
RETRY_S = 0.1  # chosen: between two looks for a sensor that is away


@dataclass(frozen=True)
class Absence:
    """Since when, and why, a sensor is away."""

    since_s: float
    why: str


class SensorCamera(Camera):
    """The camera of a real sensor, with its ring where it has one; closing it makes the LEDs dark."""

    def __init__(
        self, sensor: Sensor, options: CaptureOptions, *, bundle: Bundle | ChooseBundle | None = None, url: str,
        by_serial: bool, surroundings: Surroundings,
    ) -> None:  # fmt: skip
        """Open `sensor`; raises CameraError, BoardError or InputError, and then the LEDs are dark.

        A function for `bundle` is called when the ring is open and the camera is not yet.
        `by_serial`: its serial number is its own, so it is found again at any port.
        """
        self.url = url
        self._sensor, self._by_serial = sensor, by_serial
        self._given = options
        self._options = ConnectOptions(self._given, None)
        self._choose = bundle
        self._surroundings, self._clock = surroundings, surroundings.kernel.clock
        self._closing = threading.Event()
        self._past = Counts()
        self._last, self._reconnections = -1, 0
        self._absence: Absence | None = None
        self._connection: Connection | None = None
        self._exchange = threading.Lock()
        """held while what is wanted, or what it is put into effect on, is exchanged: nothing wanted is lost between"""
        self._connect(sensor)

    def _connect(self, sensor: Sensor) -> None:
        connection = Connection(
            sensor, self._options_for, named_ring=self._given.ring, url=self.url, around=self._surroundings
        )
        with self._exchange:
            if connection.wanted is not self._options:  # adopted while the sensor was being opened
                try:
                    connection.apply(self._options, self._options.options.controls())
                except BaseException:
                    connection.close()
                    raise
            if self._options.shape is None:  # whatever it offers when it is back, frames keep their size
                self._options = replace(self._options, shape=connection.camera.image_shape)
            self._sensor, self._connection = sensor, connection
        self.ring = connection.ring
        self.controls: CameraControls | None = connection.camera.controls
        self.image_shape = connection.camera.image_shape
        self._offset = self._last + 1
        self._first: int | None = None

    def _options_for(self, ring: LightRing | None) -> ConnectOptions:
        """Return how the sensor is to be set, whose ring is open: as its bundle says at first, then as adopted last."""
        self.ring, choose, self._choose = ring, self._choose, None
        bundle = choose(self) if callable(choose) else choose
        if bundle is not None:
            self._warn_of_dark(bundle.colours)
            self._options = ConnectOptions(self._given.over(bundle.manifest.camera), bundle.colours, bundle.image_shape)
        return self._options

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set and light the sensor like this from now on; controls that the URL names stay as it says.

        Frames are of the new light after that; a sensor that is away gets it when it is back. Raises CameraError,
        BoardError or InputError; then the sensor is set as before, or looked for.
        """
        before = self._options
        self._warn_of_dark(colours)
        if unknown := sorted(set(controls) - set(KNOBS)):
            raise CameraError(f"{self.url} has no control {unknown[0]!r} (known are: {', '.join(KNOBS)}): leave it out")
        recorded = {**before.options.model_dump(include=before.options.model_fields_set), **controls}
        with self._exchange:
            self._options = replace(before, options=self._given.over(recorded), colours=colours)
            connection = self._connection  # the thread that reads may let go of it at any time
        if connection is None:
            return
        try:
            named = {name: value for name, value in controls.items() if name not in self._given.model_fields_set}
            connection.apply(self._options, named)
        except GellightError:
            with self._exchange:
                self._options, connection = before, self._connection
            try:
                if connection is not None:
                    connection.apply(before, before.options.controls())
            except GellightError as error:
                logger.warning("the sensor is not set as before: %s", error)
            raise

    # ---- reading ----

    @property
    def timing(self) -> CameraTiming | None:
        """When its rows are exposed; None while the sensor is away."""
        connection = self._connection
        return connection.camera.timing if connection else None

    def read(self) -> CameraFrame:
        """Wait for the newest frame that was exposed after the LEDs were lit.

        Raises ReconnectingError while the sensor is away, at once when it goes and then every half second; CameraError
        after `close`.
        """
        if self._connection is None:
            self._return()
        if self._closing.is_set() or self._connection is None:
            self._release()  # it may have come back in the moment in which it was closed
            raise self._closed()
        try:
            return self._numbered(self._connection.newest())
        except (UnpluggedError, StalledError, BoardError) as error:
            if self._closing.is_set():
                raise self._closed() from error
            logger.warning("%s", error)
            self._absence = absence = Absence(self._clock(), str(error))
            self._release()
            raise self._reconnecting(absence) from error

    def _warn_of_dark(self, colours: NDArray[np.uint8] | None) -> None:
        if colours is None and (self._sensor.ring or self._given.ring):
            logger.warning("%s: the calibration does not tell the colours of its LEDs: they stay dark", self.url)

    def _numbered(self, frame: CameraFrame) -> CameraFrame:
        """Continue the numbers of the frames before a reconnection."""
        if self._first is None:
            self._first = frame.sequence
        self._last = self._offset + (frame.sequence - self._first) % 2**32
        return replace(frame, sequence=self._last)

    # ---- away and back ----

    def _closed(self) -> CameraError:
        return CameraError(f"camera {self.url} is closed: open it again")

    def _reconnecting(self, absence: Absence) -> ReconnectingError:
        away_s = self._clock() - absence.since_s
        return ReconnectingError(f"reconnecting to sensor {self._sensor.name} since {away_s:.1f} s: {absence.why}")

    def _return(self) -> None:
        """Look for the sensor for a while; ReconnectingError if it is not back."""
        deadline_s = self._clock() + LOOK_S
        absence = self._absence or Absence(self._clock(), "it was unplugged")
        while not self._closing.is_set():
            try:
                self._connect(self._surroundings.look().again(self._sensor, by_serial=self._by_serial))
            except GellightError as error:
                self._absence = absence = replace(absence, why=str(error))
            else:
                self._absence, self._reconnections = None, self._reconnections + 1
                logger.warning("sensor %s is back at USB %s", self._sensor.name, self._sensor.port)
                return
            if self._clock() >= deadline_s:
                raise self._reconnecting(absence)
            self._surroundings.wait(self._closing, RETRY_S)

    def _release(self) -> None:
        """Make the LEDs dark and close what is open."""
        connection, self._connection = self._connection, None
        self.ring = self.controls = None
        if connection is not None:
            self._past += connection.camera.counts
            connection.close()

    def status(self) -> CameraStatus:
        """Return name, connection and counts over all connections, ready for JSON."""
        connection, absence = self._connection, self._absence
        camera = connection.camera if connection else None
        counts = self._past + camera.counts if camera else self._past
        return {
            "name": self._sensor.name,
            "node": self._sensor.camera.path,
            "connection": "reconnecting" if absence else "connected",
            "reconnecting_s": round(self._clock() - absence.since_s, 2) if absence else None,
            "why": absence.why if absence else None,
            "reconnections": self._reconnections,
            "mode": str(camera.mode) if camera else None,
            **counts.as_json(),
        }

    def close(self) -> None:
        """Make the LEDs dark and close the camera; reading afterwards raises CameraError."""
        self._closing.set()
        self._release()


def open_sensor(
    url: str, *, bundle: Bundle | ChooseBundle | None = None, surroundings: Surroundings | None = None
) -> SensorCamera:
    """Open `auto`, `sensor://NAME` or `v4l2:///dev/...`, each with the parameters of `CaptureOptions`.

    Raises CameraError, BoardError or InputError, naming what is there and what to do.
    """
    around = surroundings or Surroundings(kernel=LINUX)
    place, options = parse_url(url)
    if not place:
        raise InputError(
            f"{url} names no sensor: give auto, sensor://NAME or v4l2:///dev/video0; `gellight find` lists all"
        )
    found = around.look()
    if url.startswith("v4l2://"):
        sensor = _camera_alone(found, place)
    else:
        sensor = found.called(place) if url.startswith("sensor://") else found.only()
    _check_ring(found, sensor, options)
    return SensorCamera(
        sensor, options, bundle=bundle, url=url, by_serial=found.has_own_serial(sensor), surroundings=around
    )


def _camera_alone(found: Discovery, path: str) -> Sensor:
    """Return the camera at `path`, without a ring: a v4l2:// URL takes the one it names, or none."""
    try:
        return replace(found.of_camera(path), ring=None)
    except UnpluggedError:
        if not os.path.exists(path):  # noqa: PTH110  (Path.exists raises for a name that is too long)
            raise
    node = Node(path=str(Path(path).resolve()), stable=path, name="", usb=None)  # no camera: opening it will say so
    return Sensor(camera=node, ring=None)


def _check_ring(found: Discovery, sensor: Sensor, options: CaptureOptions) -> None:
    """Refuse a ring that is named in the URL and belongs to another camera."""
    named = options.ring
    for other in found.sensors:
        if named and other.ring and other.camera.path != sensor.camera.path and other.ring.is_at(named):
            raise CameraError(
                f"ring and camera are of different sensors: {named} belongs to the camera {other.camera.stable}, not "
                f"to {sensor.camera.stable}; use sensor://{other.name}, or the ring of this camera"
            )
