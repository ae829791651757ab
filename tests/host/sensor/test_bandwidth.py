"""Cameras of several sensors on one USB bus: who fits, who is refused, and what a descriptor reserves."""

import struct
from pathlib import Path
from typing import Any

import pytest

from gellight.base.errors import CameraError, InputError
from gellight.sensor import bandwidth
from gellight.sensor.bandwidth import Need, check_bandwidth, reservations_mbps
from gellight.sensor.v4l2.formats import Mode
from tests.helpers.sensor_bench import Bench
from tests.virtual_usb.descriptors import VideoModes, configuration_descriptor

WIDE = {"MJPG": {(640, 480): [30]}, "YUYV": {(640, 480): [30]}}
RAW = {"YUYV": {(640, 480): [30]}}
SIZES = (192, 384, 512, 640, 800, 944, 1280, 1600, 1984, 2688, 3060)
"""bytes in a microframe, of the alternate settings of a common camera"""


@pytest.fixture(autouse=True)
def no_bundles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


def isochronous(sizes: tuple[int, ...] = SIZES, interval: int = 1) -> bytes:
    """Descriptors of a camera with one alternate setting for each size."""
    settings = b""
    for number, size in enumerate((0, *sizes)):
        packets = -(-size // 1024) or 1
        packed = size // packets | (packets - 1) << 11
        settings += struct.pack("9B", 9, 4, 1, number, int(size > 0), 14, 2, 0, 0)
        settings += struct.pack("<BBBBHB", 7, 5, 0x81, 5, packed, interval) if size else b""
    return bytes(18).replace(b"\0", b"\x12", 1) + struct.pack("9B", 9, 4, 0, 0, 0, 14, 1, 0, 0) + settings


def plug(bench: Bench, port: str, serial: str, descriptors: bytes | None = None, **changes: Any) -> None:
    bench.plug(port, serial, formats=changes.pop("formats", WIDE), **changes)
    folder = bench.usb.sysfs / "bus" / "usb" / "devices" / port
    folder.mkdir(parents=True, exist_ok=True)
    if descriptors is not None:
        (folder / "descriptors").write_bytes(descriptors)


def test_a_camera_may_reserve_its_alternate_settings_and_a_bulk_one_nothing() -> None:
    found = reservations_mbps(isochronous(), 480)
    assert found == pytest.approx([size // (-(-size // 1024)) * (-(-size // 1024)) * 8000 * 8e-6 for size in SIZES])
    assert found[-1] == pytest.approx(195.8, abs=0.1)
    assert reservations_mbps(isochronous((1023,)), 12) == pytest.approx([8.184])
    assert reservations_mbps(isochronous((800,), interval=2), 480) == pytest.approx([25.6])
    assert reservations_mbps(configuration_descriptor(VideoModes(((640, 480),), (333333,))), 480) == []


@pytest.mark.parametrize("content", [b"", b"\x09", b"\x00" * 40, b"\xff" * 40, isochronous()[:50], b"\x02\x04\x02\x05"])
def test_what_is_no_descriptor_reserves_nothing_and_does_not_break(content: bytes) -> None:
    assert reservations_mbps(content, 480) == reservations_mbps(content, 480)
    assert all(size > 0 for size in reservations_mbps(content, 480))


def test_compressed_pictures_of_two_sensors_fit_on_a_bus(bench: Bench) -> None:
    for port, serial in (("1-1", "A"), ("1-2", "B")):
        plug(bench, port, serial, isochronous())
    check_bandwidth(["sensor://A", "sensor://B"], surroundings=bench.surroundings)


def test_pictures_that_do_not_fit_are_refused_with_the_needs_and_the_ways_out(bench: Bench) -> None:
    for number, serial in enumerate("ABC", 1):
        plug(bench, f"1-{number}", serial, isochronous(), formats=RAW)
    check_bandwidth(["sensor://A", "sensor://B"], surroundings=bench.surroundings)
    with pytest.raises(InputError) as refusal:
        check_bandwidth([f"sensor://{name}" for name in "ABC"], surroundings=bench.surroundings)
    said = str(refusal.value)
    assert "USB bus 1 can reserve 384 Mbit/s for cameras, and these need 516" in said
    assert "sensor://A 172 Mbit/s (YUYV 640x480 at 30 fps)" in said
    assert "another bus" in said
    assert "?format=MJPG" in said


def test_another_bus_and_a_smaller_format_are_ways_out(bench: Bench) -> None:
    for port, serial in (("1-1", "A"), ("1-2", "B"), ("2-1", "C")):
        plug(bench, port, serial, isochronous(), formats={**RAW, "MJPG": {(640, 480): [30, 15]}})
    raw = [f"sensor://{name}?format=YUYV" for name in "ABC"]
    check_bandwidth(raw, surroundings=bench.surroundings)
    plug(bench, "1-3", "D", isochronous(), formats={**RAW, "MJPG": {(640, 480): [30, 15]}})
    with pytest.raises(InputError, match="USB bus 1 "):
        check_bandwidth([*raw, "sensor://D?format=YUYV"], surroundings=bench.surroundings)
    check_bandwidth([*raw, "sensor://D?format=MJPG&fps=15"], surroundings=bench.surroundings)


def test_without_descriptors_the_pictures_themselves_count(bench: Bench) -> None:
    for number, serial in enumerate("ABC", 1):
        plug(bench, f"1-{number}", serial, formats=RAW)
    with pytest.raises(InputError, match=r"these need 442: .*A 147 Mbit/s"):
        check_bandwidth([f"sensor://{name}" for name in "ABC"], surroundings=bench.surroundings)


@pytest.mark.parametrize(("cameras", "fit"), [(10, True), (11, False)])
def test_compressed_pictures_take_four_bits_a_pixel_and_cameras_four_fifths_of_a_bus(cameras: int, fit: bool) -> None:
    """By hand: 640 x 480 pixels, 30 times a second, are 36.9 Mbit/s, and 480 Mbit/s carry 384 of cameras."""
    bits = bandwidth.BITS.get("MJPG", bandwidth.COMPRESSED_BITS) * 640 * 480 * 30e-6
    mode = Mode(letters="MJPG", width=640, height=480, fps=30)
    needs = [Need(url=str(n), bus="1", speed_mbps=480, mode=mode, mbps=bits) for n in range(cameras)]
    if fit:
        bandwidth._check_bus("1", needs)
        return
    with pytest.raises(InputError):
        bandwidth._check_bus("1", needs)


def test_one_sensor_by_two_names_one_that_is_not_there_and_auto_beside_another_are_refused(bench: Bench) -> None:
    plug(bench, "1-1", "A", isochronous())
    with pytest.raises(InputError, match="sensor://A and sensor://1-1 are the same sensor"):
        check_bandwidth(["sensor://A", "sensor://1-1"], surroundings=bench.surroundings)
    plug(bench, "1-2", "B", isochronous())
    with pytest.raises(CameraError, match="no sensor is called C"):
        check_bandwidth(["sensor://C", "sensor://A"], surroundings=bench.surroundings)
    check_bandwidth(["sensor://A", "sensor://C"], surroundings=bench.surroundings)  # C runs, and is unplugged
    with pytest.raises(CameraError, match="2 sensors are plugged in: choose"):
        check_bandwidth(["auto", "sensor://A"], surroundings=bench.surroundings)
    check_bandwidth(["sensor://anything"], surroundings=bench.surroundings)
