"""What the doctor says of the current that hubs give to cameras and light rings."""

from pathlib import Path

import pytest

from gellight.lab.doctor.power import check_power
from gellight.sensor.findings import Finding, Level
from tests.helpers.usb_tree import UsbTree

WEBCAM = (0x046D, 0x0825)


@pytest.fixture
def usb(tmp_path: Path) -> UsbTree:
    return UsbTree(tmp_path)


def plug_sensor(usb: UsbTree, camera_ma: int = 500, ring_ma: int = 500, *, refused: bool = False) -> None:
    usb.plug("1-4.1", ids=WEBCAM, cameras=1, needs_ma=camera_ma)
    usb.plug("1-4.2", rings=0 if refused else 1, needs_ma=ring_ma, refused=refused)


def found(usb: UsbTree) -> list[Finding]:
    return list(check_power(usb.sysfs, {"1-4.1"}))


def test_a_hub_with_a_supply_gives_camera_and_ring_what_they_ask_for(usb: UsbTree) -> None:
    usb.hub("1-4", own_supply=True)
    plug_sensor(usb)
    (finding,) = found(usb)
    assert finding.level is Level.OK
    assert "500 mA and Tactile sensor 500 mA: the hub at USB 1-4, self-powered, gives 500 mA a port" in finding.text


def test_a_ring_that_linux_refused_is_found_without_its_node(usb: UsbTree) -> None:
    usb.hub("1-4", own_supply=False)
    plug_sensor(usb, camera_ma=100, refused=True)
    finding = found(usb)[0]
    assert finding.level is Level.PROBLEM
    assert "at USB 1-4.2 asks for 500 mA" in finding.text
    assert "bus-powered, gives 100, so Linux does not switch it on" in finding.text
    assert "a power supply of its own" in finding.remedy


def test_what_hangs_at_a_hub_without_a_supply_is_added_up(usb: UsbTree) -> None:
    """Each port gives enough, but not the one that the hub hangs at."""
    usb.hub("1-4", own_supply=False)
    plug_sensor(usb, camera_ma=100, ring_ma=100)
    assert [finding.level for finding in found(usb)] == [Level.OK]
    for port in ("1-4.3", "1-4.4"):
        usb.plug(port, ids=WEBCAM, needs_ma=100)
    assert [finding.level for finding in found(usb)] == [Level.OK]
    usb.hub("1-4", own_supply=False, needs_ma=102)
    (finding,) = found(usb)
    assert finding.level is Level.PROBLEM
    assert "may draw 502 mA" in finding.text
    assert "through one port, which gives 500" in finding.text


@pytest.mark.parametrize(
    ("speed", "own_supply", "needs_ma", "level"),
    [
        ("5000", False, 150, Level.OK),
        ("5000", False, 152, Level.PROBLEM),
        ("480", False, 100, Level.OK),
        ("480", False, 102, Level.PROBLEM),
        ("480", True, 500, Level.OK),
        ("480", True, 502, Level.PROBLEM),
    ],
)
def test_a_hub_of_usb_3_gives_more(speed: str, own_supply: bool, needs_ma: int, level: Level, usb: UsbTree) -> None:
    usb.hub("2-1", own_supply=own_supply, speed=speed)
    usb.plug("2-1.1", rings=1, needs_ma=needs_ma)
    assert [finding.level for finding in check_power(usb.sysfs, ())] == [level]


def test_a_port_of_the_computer_gives_a_ring_enough(usb: UsbTree) -> None:
    usb.plug("1-2", rings=1, needs_ma=500)
    (finding,) = check_power(usb.sysfs, ())
    assert (finding.level, finding.text) == (Level.OK, "Tactile sensor 500 mA: the computer gives 500 mA a port")


def test_a_webcam_alone_is_no_concern(usb: UsbTree) -> None:
    usb.hub("1-4", own_supply=False)
    usb.plug("1-4.1", ids=WEBCAM, cameras=1, needs_ma=500)
    usb.plug("1-3", rings=1)
    assert list(check_power(usb.sysfs, ())) == []
