"""What the doctor says of boards and cameras that Linux has not switched on."""

from pathlib import Path

import pytest

from gellight.lab.doctor.examination import check_power
from gellight.sensor.findings import Level
from tests.helpers.usb_tree import UsbTree

WEBCAM = (0x046D, 0x0825)


@pytest.fixture
def usb(tmp_path: Path) -> UsbTree:
    return UsbTree(tmp_path)


def test_camera_and_ring_that_are_switched_on_have_enough(usb: UsbTree) -> None:
    usb.plug("1-4.1", ids=WEBCAM, cameras=1)
    usb.plug("1-4.2", rings=1)
    (finding,) = check_power(usb.sysfs, {"1-4.1"})
    assert finding.level is Level.OK


def test_a_ring_that_linux_refused_is_found_without_its_node(usb: UsbTree) -> None:
    usb.plug("1-4.1", ids=WEBCAM, cameras=1)
    usb.plug("1-4.2", rings=0, refused=True)
    (finding,) = check_power(usb.sysfs, {"1-4.1"})
    assert finding.level is Level.PROBLEM
    assert "at USB 1-4.2 asks for more current than its hub gives, so Linux does not switch it on" in finding.text
    assert "a power supply of its own" in finding.remedy


def test_nothing_is_said_of_the_devices_of_others(usb: UsbTree) -> None:
    usb.plug("1-3", ids=WEBCAM, refused=True)
    assert list(check_power(usb.sysfs, ())) == []
