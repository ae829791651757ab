"""A real sensor: its camera set and its ring lit as the calibration bundle says, found again after it was unplugged.

What is read is always from the sensor that was opened first, known by its serial number or else its USB port, and was
exposed after its ring was lit. While the sensor is away, `read` raises ReconnectingError and looks for it; frames go on
with rising sequence numbers, so nothing that was taken before is ever taken for new.
"""

import logging
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np

from gellight.calibration import Calibration
from gellight.camera import Camera, CameraControls, ReconnectingError
from gellight.discovery import DEV, SYSFS, Discovery, Node, Sensor, discover
from gellight.errors import BoardError, CameraError, GellightError
from gellight.frames import CameraFrame
from gellight.lighting.timing import CameraTiming
from gellight.ring import LightRing, connect
from gellight.v4l2.errors import StalledError, UnpluggedError
from gellight.v4l2.kernel import Kernel, LinuxKernel
from gellight.v4l2.options import CaptureOptions, parse_url
from gellight.v4l2.stream import Counts
from gellight.v4l2.video_camera import V4l2Camera

logger = logging.getLogger(__name__)

LOOK_S = 0.5
"""so long one `read` looks for a sensor that is away"""
RETRY_S = 0.1
WATCH_S = 2.0
"""how often ring and controls are looked at while frames come"""
OLD_S = 5.0
"""so long frames from before the light are waited out"""


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


class SensorCamera(Camera):
    """The camera of a real sensor, with its ring where it has one; closing it makes the LEDs dark."""

    def __init__(
        self,
        sensor: Sensor,
        options: CaptureOptions | None = None,
        *,
        calibration: Calibration | None = None,
        url: str,
        by_serial: bool,
        surroundings: Surroundings | None = None,
    ) -> None:
        """Open `sensor`; raises CameraError, BoardError or InputError, and then the LEDs are dark.

        `by_serial`: its serial number is its own, so it is found again at any port.
        """
        self.url = url
        self.stage = self.ring = None
        self._sensor, self._by_serial = sensor, by_serial
        self._given = options or CaptureOptions()
        self._remember(calibration)
        self._surroundings = surroundings or Surroundings(kernel=LinuxKernel())
        self._clock = self._surroundings.kernel.clock
        self._closing = threading.Event()
        self._camera: V4l2Camera | None = None
        self._past = Counts()
        self._offset, self._last, self._reconnections = 0, -1, 0
        self._away: tuple[float, str] | None = None
        self._connect(sensor)

    # ---- connecting ----

    def _remember(self, calibration: Calibration | None) -> None:
        self._calibration = calibration
        self._options = self._given.over(calibration.manifest.camera if calibration else {})

    def adopt(self, calibration: Calibration) -> None:
        """Set and light the sensor as another bundle of the same image size says, from now on.

        Frames are of the new light after that. Raises CameraError, BoardError or InputError; then the sensor is set as
        before, or looked for.
        """
        before = self._calibration
        self._remember(calibration)
        try:
            self._apply()
        except GellightError:
            if before is not None:
                self._remember(before)
                self._apply()
            raise

    def _apply(self) -> None:
        """Set controls and light of the sensor that is connected; one that is away gets them when it is back."""
        if self._camera is not None:
            self._camera.controls.lock(self._options.controls(), power_line_hz=int(self._options.power_line_hz))
            self._light(self.ring)
            self._lit_s = self._clock()

    def _connect(self, sensor: Sensor) -> None:
        """Open ring and camera of `sensor`, set and light them."""
        ring = self._open_ring(sensor)
        try:
            camera = V4l2Camera(
                sensor.camera.path,
                self._options,
                shape=self._calibration.image_shape if self._calibration else None,
                url=self.url,
                kernel=self._surroundings.kernel,
                sysfs=self._surroundings.sysfs,
            )
        except BaseException:
            _darken(ring)
            raise
        try:
            self._light(ring)
        except BaseException:
            camera.close()
            _darken(ring)
            raise
        self._sensor, self._camera, self.ring = sensor, camera, ring
        self.controls: CameraControls | None = camera.controls
        self.image_shape = camera.image_shape
        self._lit_s = self._watched_s = self._clock()
        self._offset = self._last + 1
        self._first: int | None = None

    def _open_ring(self, sensor: Sensor) -> LightRing | None:
        named = self._options.ring
        if named is None and sensor.ring is None:
            return None
        ring = self._surroundings.open_ring(named or (sensor.ring.path if sensor.ring else ""))
        expected = sensor.ring.usb.serial if named is None and sensor.ring and sensor.ring.usb else ""
        found = ring.hello.unique_id.hex().upper()
        if _is_board_number(expected) and expected.upper() != found:
            ring.close()
            raise BoardError(
                f"the ring at {ring.transport.url} is {found}, the one beside the camera is {expected}: ring and "
                "camera are of different sensors; unplug both and plug them in again"
            )
        return ring

    def _light(self, ring: LightRing | None) -> None:
        """Light the LEDs as they were when the bundle was made, and wait until they are."""
        if ring is None or self._calibration is None:
            return
        if not self._calibration.manifest.led:
            logger.warning("%s does not tell the colours of its LEDs: they stay dark", self._calibration.source)
            return
        colours = np.array([led.rgb for led in self._calibration.manifest.led], np.uint8)
        ring.wait_for_light(ring.set_leds(colours).light_id)

    # ---- reading ----

    @property
    def timing(self) -> CameraTiming | None:
        """When its rows are exposed; None while the sensor is away."""
        return self._camera.timing if self._camera else None

    def selfcheck(self, pixel_size_mm: tuple[float, float]) -> None:
        """Return None: nobody knows what was really pressed."""

    def read(self) -> CameraFrame:
        """Wait for the newest frame that was exposed after the LEDs were lit.

        Raises ReconnectingError while the sensor is away, at once when it goes and then every half second; CameraError
        after `close`.
        """
        if self._closing.is_set():
            raise CameraError(f"camera {self.url} is closed: open it again")
        if self._away is not None:
            self._return()
        try:
            return self._fresh()
        except (UnpluggedError, StalledError, BoardError) as error:
            raise self._left(error) from error

    def _fresh(self) -> CameraFrame:
        assert self._camera is not None
        while True:
            frame = self._camera.read()
            self._watch()
            # How late a camera stamps its frames is often not known: a frame counts once it was lit in any case.
            if frame.time_s - self._camera.timing.stamp_error_s > self._lit_s:
                return self._numbered(frame)
            if self._clock() > self._lit_s + OLD_S:
                break
        raise StalledError(f"{self._sensor.camera.stable}: its time stamps stand still; it is started anew")

    def _numbered(self, frame: CameraFrame) -> CameraFrame:
        """Continue the numbers of the frames before a reconnection."""
        if self._first is None:
            self._first = frame.sequence
        self._last = self._offset + (frame.sequence - self._first) % 2**32
        return replace(frame, sequence=self._last)

    def _watch(self) -> None:
        """Look now and then whether ring and controls are as they have to be."""
        now_s = self._clock()
        if now_s - self._watched_s < WATCH_S or self._camera is None:
            return
        self._watched_s = now_s
        node = self._sensor.ring.path if self._sensor.ring else None
        if node is not None and self._options.ring is None and not Path(node).exists():
            raise UnpluggedError(f"the light ring at {node} was unplugged: plug it in again")
        if self.ring is not None:
            self.ring.clock()  # BoardError where the board has died: its LEDs are dark then
        wrong = self._camera.controls.deviations()
        if wrong:
            raise StalledError(
                f"somebody changed the camera: {', '.join(map(str, wrong))}; it is set anew, end other programmes"
            )

    # ---- away and back ----

    def _left(self, error: GellightError) -> ReconnectingError:
        """Let go of the sensor and remember since when and why."""
        logger.warning("%s", error)
        self._away = self._clock(), str(error)
        self._release()
        return self._absent()

    def _absent(self) -> ReconnectingError:
        since_s, why = self._away or (self._clock(), "")
        return ReconnectingError(
            f"reconnecting to sensor {self._sensor.name} since {self._clock() - since_s:.1f} s: {why}"
        )

    def _return(self) -> None:
        """Look for the sensor for a while; ReconnectingError if it is not back."""
        deadline_s = self._clock() + LOOK_S
        while not self._closing.is_set():
            try:
                found = self._surroundings.look().again(self._sensor, by_serial=self._by_serial)
                self._connect(found)
            except GellightError as error:
                self._away = (self._away or (self._clock(), ""))[0], str(error)
            else:
                self._away, self._reconnections = None, self._reconnections + 1
                logger.warning("sensor %s is back at USB %s", self._sensor.name, self._sensor.port)
                return
            if self._clock() >= deadline_s:
                break
            self._surroundings.wait(self._closing, RETRY_S)
        raise self._absent()

    def _release(self) -> None:
        """Make the LEDs dark and close what is open; what is gone cannot object."""
        ring, self.ring = self.ring, None
        camera, self._camera = self._camera, None
        self.controls = None
        _darken(ring)
        if camera is not None:
            self._past = _sum(self._past, camera.counts)
            try:
                camera.close()
            except CameraError as error:
                logger.warning("%s", error)

    def status(self) -> dict[str, object]:
        """Return name, connection and counts over all connections, ready for JSON."""
        camera, away = self._camera, self._away
        counts = _sum(self._past, camera.counts) if camera else self._past
        return {
            "name": self._sensor.name,
            "node": self._sensor.camera.path,
            "connection": "reconnecting" if away else "connected",
            "reconnecting_s": round(self._clock() - away[0], 2) if away else None,
            "why": away[1] if away else None,
            "reconnections": self._reconnections,
            "mode": str(camera.mode) if camera else None,
            **counts.as_json(),
        }

    def close(self) -> None:
        """Make the LEDs dark and close the camera; reading afterwards raises CameraError."""
        self._closing.set()
        self._release()


def open_sensor(
    url: str, *, calibration: Calibration | None = None, surroundings: Surroundings | None = None
) -> SensorCamera:
    """Open `auto`, `sensor://NAME` or `v4l2:///dev/...`, each with the parameters of `CaptureOptions`.

    Raises CameraError, BoardError or InputError, naming what is there and what to do.
    """
    around = surroundings or Surroundings(kernel=LinuxKernel())
    place, options = parse_url(url)
    found = around.look()
    if url.startswith("v4l2://"):
        sensor = _camera_alone(found, place)
    elif url.startswith("sensor://"):
        sensor = found.called(place)
    else:
        sensor = found.only()
    _check_ring(found, sensor, options)
    return SensorCamera(
        sensor, options, calibration=calibration, url=url, by_serial=found.has_own_serial(sensor), surroundings=around
    )


def _camera_alone(found: Discovery, path: str) -> Sensor:
    """Return the camera at `path`, without a ring: a v4l2:// URL takes the one it names, or none."""
    try:
        return replace(found.of_camera(path), ring=None)
    except UnpluggedError:
        if not Path(path).exists():
            raise
    node = Node(path=str(Path(path).resolve()), stable=path, name="", usb=None)  # no camera: opening it will say so
    return Sensor(camera=node, ring=None)


def _check_ring(found: Discovery, sensor: Sensor, options: CaptureOptions) -> None:
    """Refuse a ring that is named in the URL and belongs to another camera."""
    named = options.ring
    for other in found.sensors:
        if named and other.ring and other.camera.path != sensor.camera.path and _names(named, other):
            raise CameraError(
                f"ring and camera are of different sensors: {named} belongs to the camera {other.camera.stable}, not "
                f"to {sensor.camera.stable}; use sensor://{other.name}, or the ring of this camera"
            )


def _names(ring_url: str, sensor: Sensor) -> bool:
    assert sensor.ring is not None
    serial = sensor.ring.usb.serial if sensor.ring.usb else ""
    by_number = bool(serial) and ring_url in (f"serial://{serial}", f"usb://{serial}")
    return by_number or str(Path(ring_url).resolve()) == str(Path(sensor.ring.path).resolve())


def _darken(ring: LightRing | None) -> None:
    """Close a ring, whatever state it is in: its board darkens the LEDs by itself when the host is silent."""
    if ring is not None:
        try:
            ring.close()
        except GellightError as error:
            logger.warning("%s", error)


def _is_board_number(serial: str) -> bool:
    return len(serial) == 16 and all(digit in "0123456789abcdefABCDEF" for digit in serial)


def _sum(one: Counts, other: Counts) -> Counts:
    return Counts(**{field.name: asdict(one)[field.name] + asdict(other)[field.name] for field in fields(Counts)})
