"""The descriptors of the virtual sensor: a ring board like the real one, and a camera, in one USB device.

Interfaces 0 and 1 and their endpoints are those of the firmware (firmware/boards/rp2/usb_descriptors.c), so that
every way to the real board is also a way to this one. Interfaces 2 and 3 are a camera of USB Video Class 1.1, with a
bulk endpoint: an isochronous one would have to be served every 125 us.
"""

import struct
from dataclasses import dataclass

from gellight.ring.transport import PRODUCT, VENDOR

RELEASE = 0x0100
MANUFACTURER, NAME = "GelLight", "GelLight virtual sensor"
NOTIFY_ENDPOINT, SERIAL_ENDPOINT, VIDEO_ENDPOINT = 1, 2, 3
CONTROL_INTERFACE, STREAMING_INTERFACE = 2, 3
CAMERA_UNIT, PROCESSING_UNIT, OUTPUT_UNIT = 1, 2, 3
MJPG, YUYV = 1, 2
"""format index of each"""
CLOCK_HZ = 48_000_000
INTERFACES = ((2, 2, 0), (10, 0, 0), (14, 1, 0), (14, 2, 0))
"""class, subclass and protocol of each: serial control, serial data, video control, video streaming"""
COMPOSITE = (0xEF, 2, 1)
_CLASS_SPECIFIC, _BULK, _INTERRUPT, _IN = 0x24, 2, 3, 0x80
_YUY2 = bytes.fromhex("5955593200001000800000aa00389b71")
_CAMERA_CONTROLS = b"\x0e\x00\x00"
"""auto exposure mode, auto exposure priority, exposure time"""
_PROCESSING_CONTROLS = b"\x40\x16"
"""white balance temperature; gain, power line frequency, white balance automatic"""


@dataclass(frozen=True)
class VideoModes:
    """The pictures that the camera offers."""

    sizes: tuple[tuple[int, int], ...]
    """(width, height) of each frame index, from 1"""
    intervals: tuple[int, ...]
    """100 ns from frame to frame, shortest first"""

    def picture_bytes(self, size_index: int) -> int:
        """Return the most that a picture takes: YUYV is two bytes a pixel, and JPEG never needs more."""
        width, height = self.sizes[size_index - 1]
        return width * height * 2 + 4096


def device_descriptor() -> bytes:
    return struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0200, *COMPOSITE, 64, VENDOR, PRODUCT, RELEASE, 1, 2, 3, 1)


def string_descriptor(index: int, serial_number: str) -> bytes | None:
    """Return a text in UTF-16, or None for a number that names none."""
    if index == 0:
        return b"\x04\x03\x09\x04"
    texts = (MANUFACTURER, NAME, serial_number)
    if index > len(texts):
        return None
    text = texts[index - 1].encode("utf-16-le")
    return bytes((len(text) + 2, 3)) + text


def configuration_descriptor(modes: VideoModes) -> bytes:
    """Return the only configuration with all that belongs to it."""
    body = _serial_function() + _video_function(modes)
    return struct.pack("<BBHBBBBB", 9, 2, 9 + len(body), len(INTERFACES), 1, 0, 0x80, 250) + body


def _interface(number: int, endpoints: int) -> bytes:
    return struct.pack("9B", 9, 4, number, 0, endpoints, *INTERFACES[number], 0)


def _association(first: int, function: tuple[int, int, int]) -> bytes:
    return struct.pack("8B", 8, 11, first, 2, *function, 0)


def _endpoint(address: int, attributes: int, size: int, interval: int = 0) -> bytes:
    return struct.pack("<BBBBHB", 7, 5, address, attributes, size, interval)


def _specific(subtype: int, body: bytes) -> bytes:
    return struct.pack("3B", len(body) + 3, _CLASS_SPECIFIC, subtype) + body


def _serial_function() -> bytes:
    header, call, abstract, union = b"\x10\x01", b"\x00\x01", b"\x02", b"\x00\x01"
    return (
        _association(0, (2, 2, 0))
        + _interface(0, 1)
        + _specific(0, header) + _specific(1, call) + _specific(2, abstract) + _specific(6, union)
        + _endpoint(_IN | NOTIFY_ENDPOINT, _INTERRUPT, 8, 8)
        + _interface(1, 2)
        + _endpoint(SERIAL_ENDPOINT, _BULK, 512)
        + _endpoint(_IN | SERIAL_ENDPOINT, _BULK, 512)
    )  # fmt: skip


def _video_function(modes: VideoModes) -> bytes:
    return (
        _association(CONTROL_INTERFACE, (14, 3, 0))
        + _interface(CONTROL_INTERFACE, 0)
        + _video_control()
        + _interface(STREAMING_INTERFACE, 1)
        + _video_streaming(modes)
        + _endpoint(_IN | VIDEO_ENDPOINT, _BULK, 512)
    )


def _video_control() -> bytes:
    """Camera terminal -> processing unit -> output terminal (UVC 1.1, 3.7.2)."""
    camera = struct.pack("<BHBBHHHB3s", CAMERA_UNIT, 0x0201, 0, 0, 0, 0, 0, 3, _CAMERA_CONTROLS)
    processing = struct.pack("<BBHB2sBB", PROCESSING_UNIT, CAMERA_UNIT, 0, 2, _PROCESSING_CONTROLS, 0, 0)
    output = struct.pack("<BHBBB", OUTPUT_UNIT, 0x0101, 0, PROCESSING_UNIT, 0)
    body = _specific(2, camera) + _specific(5, processing) + _specific(3, output)
    return _specific(1, struct.pack("<HHIBB", 0x0110, 13 + len(body), CLOCK_HZ, 1, STREAMING_INTERFACE)) + body


def _video_streaming(modes: VideoModes) -> bytes:
    """Two formats with the same sizes and rates, and their colours (UVC 1.1, 3.9.2)."""
    count, colours = len(modes.sizes), _specific(13, b"\x01\x01\x04")
    body = _specific(6, struct.pack("8B", MJPG, count, 1, 1, 0, 0, 0, 0)) + _frames(modes, 7) + colours
    body += _specific(4, struct.pack("BB16s6B", YUYV, count, _YUY2, 16, 1, 0, 0, 0, 0)) + _frames(modes, 5) + colours
    header = struct.pack("<BHBBBBBBBBB", 2, 15 + len(body), _IN | VIDEO_ENDPOINT, 0, OUTPUT_UNIT, 0, 0, 0, 1, 0, 0)
    return _specific(1, header) + body


def _frames(modes: VideoModes, subtype: int) -> bytes:
    frames = b""
    for index, (width, height) in enumerate(modes.sizes, 1):
        size = modes.picture_bytes(index)
        rates = [min(16 * width * height * 10**7 // interval, 0xFFFFFFFF) for interval in modes.intervals]
        head = struct.pack("<BBHHIIIIB", index, 0, width, height, min(rates), max(rates), size, modes.intervals[0],
                           len(modes.intervals))  # fmt: skip
        frames += _specific(subtype, head + struct.pack(f"<{len(modes.intervals)}I", *modes.intervals))
    return frames
