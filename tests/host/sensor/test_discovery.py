"""Which camera belongs to which ring: by the USB parent they share, and never by a guess."""

from pathlib import Path

import pytest

from gellight.base.errors import CameraError
from gellight.sensor.discovery import Discovery, discover
from gellight.sensor.v4l2.errors import UnpluggedError
from tests.helpers.usb_tree import UsbTree

WEBCAM = (0x046D, 0x0825)


@pytest.fixture
def usb(tmp_path: Path) -> UsbTree:
    return UsbTree(tmp_path)


def seen(usb: UsbTree) -> Discovery:
    return discover(sysfs=usb.sysfs, dev=usb.dev)


def test_one_device_with_camera_and_ring_is_a_sensor(usb: UsbTree) -> None:
    camera, ring = usb.plug("1-2", serial="GL0001", cameras=1, rings=1)
    (sensor,) = seen(usb).sensors
    assert (sensor.camera.path, sensor.ring and sensor.ring.path) == (camera, ring)
    assert (sensor.serial, sensor.port, sensor.name) == ("GL0001", "1-2", "GL0001")
    assert sensor.camera.stable.endswith("by-id/usb-GelLight_GL0001-video-index0")
    assert sensor.camera.usb.speed_mbps == 480
    assert seen(usb).only() == sensor
    assert not seen(usb).cameras, "the node of metadata is no camera"


def test_a_camera_and_a_ring_behind_a_hub_of_their_own_are_a_sensor(usb: UsbTree) -> None:
    camera, *_ = usb.plug("1-4.1", ids=WEBCAM, cameras=1)
    ring, *_ = usb.plug("1-4.2", serial="E660C06213842F2A", rings=1)
    sensor = seen(usb).only()
    assert (sensor.camera.path, sensor.ring and sensor.ring.path) == (camera, ring)
    assert sensor.name == "E660C06213842F2A", "the ring's serial number is its own"
    assert seen(usb).called("E660C06213842F2A") == seen(usb).called("1-4.1") == sensor


def test_a_webcam_at_the_root_hub_is_never_paired_with_a_ring(usb: UsbTree) -> None:
    usb.plug("1-1", serial="CAM", ids=WEBCAM, cameras=1)
    usb.plug("1-2", serial="RING", rings=1)
    found = seen(usb)
    assert not found.sensors
    with pytest.raises(
        UnpluggedError, match=r"plug both into one hub of their own, or name them with v4l2://\S+\?ring="
    ):
        found.only()


def test_a_webcam_beside_a_sensor_does_not_disturb(usb: UsbTree) -> None:
    usb.plug("1-1", serial="CAM", ids=WEBCAM, cameras=1)
    usb.plug("1-2", serial="GL0001", cameras=1, rings=1)
    assert seen(usb).only().serial == "GL0001"
    assert len(seen(usb).cameras) == 1


def test_what_cannot_be_told_apart_behind_one_hub_is_said_not_guessed(usb: UsbTree) -> None:
    usb.plug("1-4.1", ids=WEBCAM, cameras=1)
    usb.plug("1-4.3", ids=WEBCAM, cameras=1)
    usb.plug("1-4.2", serial="RING", rings=1)
    found = seen(usb)
    assert not found.sensors
    assert len(found.ambiguities) == 1
    assert "at USB 1-4 are 2 cameras and 1 rings" in found.ambiguities[0]
    assert "hub of its own" in found.ambiguities[0]


def test_every_sensor_is_listed_with_a_url_that_opens_it_alone(usb: UsbTree) -> None:
    for port, serial in (("1-1", "SAME"), ("1-2", "SAME"), ("1-3", "OWN"), ("1-4", "")):
        usb.plug(port, serial=serial, cameras=1, rings=1)
    found = seen(usb)
    urls = [found.url_of(sensor) for sensor in found.sensors]
    assert urls == ["sensor://1-1", "sensor://1-2", "sensor://OWN", "sensor://1-4"]
    assert [found.called(url.removeprefix("sensor://")) for url in urls] == list(found.sensors)


def test_the_same_serial_number_twice_is_told_and_the_ports_serve(usb: UsbTree) -> None:
    usb.plug("1-1", serial="GL0009", cameras=1, rings=1)
    usb.plug("1-2", serial="GL0009", cameras=1, rings=1)
    found = seen(usb)
    assert found.ambiguities == (
        "2 sensors have the serial number GL0009: tell them apart as sensor://1-1 or sensor://1-2",
    )
    with pytest.raises(CameraError, match="sensor://1-1 or sensor://1-2"):
        found.called("GL0009")
    with pytest.raises(CameraError, match="sensor://1-1 or sensor://1-2"):
        found.only()
    assert found.called("1-2").port == "1-2"


def test_no_sensor_and_no_such_sensor_are_told(usb: UsbTree) -> None:
    with pytest.raises(UnpluggedError, match=r"check the cable, or take the simulated sensor \(--sensor sim://\)"):
        seen(usb).only()
    usb.plug("1-1", serial="GL0001", cameras=1, rings=1)
    with pytest.raises(UnpluggedError, match=r"no sensor is called GL0002 \(there: sensor://GL0001\)"):
        seen(usb).called("GL0002")


def test_the_same_sensor_is_found_again_on_another_port_by_its_serial_number(usb: UsbTree) -> None:
    usb.plug("1-1", serial="GL0001", cameras=1, rings=1)
    sensor = seen(usb).only()
    assert seen(usb).has_own_serial(sensor)
    usb.unplug("1-1")
    usb.plug("1-3", serial="GL0002", cameras=1, rings=1)
    with pytest.raises(UnpluggedError, match="GL0001 is not there"):
        seen(usb).again(sensor, by_serial=True)
    camera, _ = usb.plug("1-2.4", serial="GL0001", cameras=1, rings=1)
    assert seen(usb).again(sensor, by_serial=True).camera.path == camera


@pytest.mark.parametrize("serial", ["", "GL0009"])
def test_without_a_serial_number_of_its_own_a_sensor_is_found_again_by_its_port(usb: UsbTree, serial: str) -> None:
    usb.plug("1-1", serial=serial, cameras=1, rings=1)
    usb.plug("1-2", serial=serial, cameras=1, rings=1)
    sensor = seen(usb).called("1-2")
    assert not seen(usb).has_own_serial(sensor)
    usb.unplug("1-2")
    with pytest.raises(UnpluggedError):
        seen(usb).again(sensor, by_serial=False)
    camera, _ = usb.plug("1-2", serial=serial, cameras=1, rings=1)
    assert seen(usb).again(sensor, by_serial=False).camera.path == camera


def test_a_camera_without_a_ring_is_found_by_its_node_and_by_its_link(usb: UsbTree) -> None:
    camera, *_ = usb.plug("1-1", serial="CAM", ids=WEBCAM, cameras=1)
    link = usb.dev / "v4l/by-id/usb-GelLight_CAM-video-index0"
    assert seen(usb).of_camera(str(link)) == seen(usb).of_camera(camera)
    assert seen(usb).of_camera(camera).ring is None
    with pytest.raises(UnpluggedError, match="no camera at"):
        seen(usb).of_camera("/dev/video99")
    metadata = next(str(node) for node in usb.dev.glob("video*") if str(node) != camera)
    with pytest.raises(UnpluggedError, match=rf"{metadata} takes no pictures: .* take {camera};"):
        seen(usb).of_camera(metadata)


@pytest.mark.parametrize(("maker", "product", "rings"), [("Acme", "GelLight ring", 1), ("GelLight fans", "Serial", 0)])
def test_a_ring_is_told_by_its_product_string_alone(usb: UsbTree, maker: str, product: str, rings: int) -> None:
    usb.plug("1-2", serial="R1", ids=(0x1234, 0x5678), rings=1)
    (device,) = usb.root.rglob("idVendor")
    device.with_name("manufacturer").write_text(maker)
    device.with_name("product").write_text(product)
    assert len(seen(usb).rings) == rings


def test_cameras_of_one_serial_number_go_by_their_ports(usb: UsbTree) -> None:
    """Both claim one link by-id, which is of the one that was plugged in last."""
    ports = usb.dev / "v4l/by-path"
    ports.mkdir()
    for port in ("1-1", "1-2"):
        (node,) = usb.plug(port, serial="SN0001", ids=WEBCAM, cameras=1)
        (ports / port).symlink_to(node)
    assert [camera.stable for camera in seen(usb).cameras] == [str(ports / "1-1"), str(ports / "1-2")]
    (told,) = seen(usb).ambiguities
    assert told.startswith("2 cameras have the serial number SN0001")
