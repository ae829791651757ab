"""The kernel, udev and pyserial take the virtual sensor for what it says it is."""

import pytest

from tests.virtual_usb.device import VirtualSensor
from tests.vm.machine.bench import ONE, TWO, Bench
from tests.vm.machine.qemu import Guest


def names(links: list[str], kind: str) -> list[str]:
    """What stands after /dev/ in the links of a kind."""
    return [link.split(" -> ")[0].removeprefix("/dev/") for link in links if f"/{kind}/" in link]


def test_udev_names_camera_and_serial_port_by_the_serial_number(bench: Bench) -> None:
    found = bench.plug("one", 0)
    prefix = f"usb-GelLight_GelLight_virtual_sensor_{ONE}"
    assert names(found["links"], "by-id") == [
        f"serial/by-id/{prefix}-if00",
        f"v4l/by-id/{prefix}-video-index0",
        f"v4l/by-id/{prefix}-video-index1",
    ]
    print(f"links {found['seconds']:.2f} s after the plug went in")


def test_camera_and_ring_share_one_usb_parent_and_say_who_they_are(guest: Guest, one: VirtualSensor) -> None:
    found = guest.run("commanding:identity", number=ONE)
    assert found["camera parent"] == found["ring parent"]
    assert found["ports"] == [[0x1209, 0x0001, "GelLight", "GelLight virtual sensor"]]


@pytest.mark.parametrize("letters", ["MJPG", "YUYV"])
def test_two_sensors_stream_at_once(guest: Guest, bench: Bench, letters: str) -> None:
    bench.plug("one", 0)
    bench.plug("two", 3)
    other = guest.aside.start("looking:stream", serial=TWO, options=f"format={letters}", count=10)
    mine = guest.run("looking:stream", serial=ONE, options=f"format={letters}", count=10)
    assert len(mine["stamps"]) == len(other.result()["stamps"]) == 10
