"""Whether the cameras of several sensors fit on their USB buses together: asked before one more is started.

An isochronous camera reserves time on its bus for as many bytes in each microframe as one of its alternate settings
has, the smallest that is enough for its pictures. What all devices of a bus reserve may fill 80 % of it (USB 2.0,
5.6.4). A camera of compressed pictures says only once it is set how much it asks for, so `COMPRESSED_BITS` a pixel are
assumed.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from gellight.base.errors import BundleError, CameraError, InputError
from gellight.bundle.bundle import SYNTHETIC, load_bundle
from gellight.bundle.store import BundleStore
from gellight.sensor.connection import Surroundings
from gellight.sensor.discovery import Discovery, Sensor
from gellight.sensor.v4l2.device import Device
from gellight.sensor.v4l2.errors import LINUX
from gellight.sensor.v4l2.formats import Mode, choose
from gellight.sensor.v4l2.options import CaptureOptions, parse_url

RESERVABLE = 0.8  # USB 2.0: of a microframe at high speed; of a frame at full speed it would be 90 %
COMPRESSED_BITS = 4.0
"""bits a pixel of MJPG: a sharp picture of the gel has 1 to 3"""
BITS = {"YUYV": 16.0, "RGB3": 24.0, "GREY": 8.0}
"""bits a pixel"""
INTERFACE, ENDPOINT = 4, 5
"""types of descriptors"""
VIDEO_STREAMING = (14, 2)  # USB video class: class and subclass of an interface
ISOCHRONOUS = 1  # USB 2.0, table 9-13: the two lowest bits of an endpoint's attributes
MICROFRAMES = {480.0: 8000, 12.0: 1000}
"""a second, by the speed of the device in Mbit/s; faster devices have those of 480"""


@dataclass(frozen=True, kw_only=True)
class Need:
    """What the camera of one sensor takes of its bus."""

    url: str
    bus: str
    speed_mbps: float
    mode: Mode
    mbps: float

    def __str__(self) -> str:
        """In words."""
        return f"{self.url} {self.mbps:.0f} Mbit/s ({self.mode})"


def check_bandwidth(urls: Sequence[str], *, surroundings: Surroundings | None = None) -> None:
    """Refuse a sensor whose camera does not fit on its bus beside those that run, or that runs already.

    urls: of real sensors: the one that is to run, and those that do, which may be unplugged. Raises InputError, which
    names the needs and the ways out, and CameraError where the first is not there.
    """
    around = surroundings or Surroundings(kernel=LINUX)
    if len(urls) < 2:
        return
    found = around.look()
    needs: list[Need] = []
    seen: dict[str, str] = {}
    for url in urls:
        place, options = parse_url(url if "://" in url or url == "auto" else f"v4l2://{url}")
        try:
            sensor = _sensor(found, url, place)
        except CameraError:
            if seen:
                continue
            raise
        if sensor.camera.path in seen:
            raise InputError(f"{seen[sensor.camera.path]} and {url} are the same sensor: it runs already")
        seen[sensor.camera.path] = url
        if sensor.camera.usb is not None:
            needs.append(_need(url, sensor, options, around))
    for bus in sorted({need.bus for need in needs}):
        _check_bus(bus, [need for need in needs if need.bus == bus])


def _check_bus(bus: str, needs: list[Need]) -> None:
    carries = RESERVABLE * max(need.speed_mbps for need in needs)
    total = sum(need.mbps for need in needs)
    if len(needs) > 1 and total > carries:
        raise InputError(
            f"USB bus {bus} can reserve {carries:.0f} Mbit/s for cameras, and these need {total:.0f}: "
            f"{', '.join(map(str, needs))}. Plug one into a port of another bus (`gellight find` shows them), or ask "
            "less of one: ?format=MJPG, ?width=320&height=240 or ?fps=15 behind its URL"
        )


def _sensor(found: Discovery, url: str, place: str) -> Sensor:
    if url.startswith(("v4l2://", "/dev/")):
        return found.of_camera(place)
    return found.called(place) if url.startswith("sensor://") else found.only()


def _need(url: str, sensor: Sensor, options: CaptureOptions, around: Surroundings) -> Need:
    usb = sensor.camera.usb
    assert usb is not None
    with Device(sensor.camera.path, kernel=around.kernel) as device:
        mode = choose(device.offers(), options.wanted(_shape(sensor)), path=sensor.camera.path)
    pictures = mode.width * mode.height * BITS.get(mode.letters, COMPRESSED_BITS) * (mode.fps or 30.0) * 1e-6
    descriptors = around.sysfs / "bus" / "usb" / "devices" / usb.port / "descriptors"
    settings = reservations_mbps(descriptors.read_bytes(), usb.speed_mbps) if descriptors.is_file() else []
    reserved = next((size for size in settings if size >= pictures), max(settings, default=pictures))
    return Need(url=url, bus=usb.port.partition("-")[0], speed_mbps=usb.speed_mbps, mode=mode, mbps=reserved)


def _shape(sensor: Sensor) -> tuple[int, int]:
    """Return the (H, W) that the sensor will be set to: that of its bundle, or of the one that is used without one."""
    try:
        return BundleStore().current(sensor.name).load().image_shape
    except BundleError:
        return load_bundle(SYNTHETIC).image_shape


def reservations_mbps(descriptors: bytes, speed_mbps: float) -> list[float]:
    """Return what the alternate settings of a camera reserve on its bus, Mbit/s, ascending; none where it is bulk.

    descriptors: as in the file of this name in sysfs. Bits 11 and 12 of a packet size count further packets in the same
    microframe (USB 2.0, 9.6.6).
    """
    microframes = MICROFRAMES.get(speed_mbps, 8000)
    sizes = {
        (size & 0x7FF) * (1 + (size >> 11 & 3)) * microframes * 8e-6 / 2 ** (interval - 1)
        for size, interval in _isochronous(descriptors)
    }
    return sorted(sizes - {0.0})


def _isochronous(descriptors: bytes) -> Iterator[tuple[int, int]]:
    """Yield packet size and interval of every isochronous endpoint of a video streaming interface."""
    at, streaming = 0, False
    while at + 2 <= len(descriptors):
        length, kind = descriptors[at], descriptors[at + 1]
        one = descriptors[at : at + length]
        if length < 2 or len(one) < length:
            return  # cut off, or no descriptors at all
        if kind == INTERFACE and length >= 9:
            streaming = (one[5], one[6]) == VIDEO_STREAMING
        if kind == ENDPOINT and streaming and length >= 7 and one[3] & 3 == ISOCHRONOUS:
            size, interval = struct.unpack_from("<HB", one, 4)
            yield size, max(interval, 1)
        at += length
